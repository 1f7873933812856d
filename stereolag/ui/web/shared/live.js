// Live media: a panel that sends camera frames or pieces of sound to the server, and draws the answers.

import { eventOf, received } from "./exchange.js";
import { html, live } from "./lit_html.js";
import { filled } from "./numbers.js";
import { base64, packed, unpacked } from "./packing.js";
import { Panel } from "./panel.js";
import { socketTo } from "./socket.js";

const IN_FLIGHT = 2; // so that the next message is on its way while one is answered
const LOOK_MS = 20;
const AGAIN_MS = 3000; // a control moved meanwhile can swallow a message on the page's own connection
const QUALITY = 0.85;
const KEPT = 30; // number of answers over which rates are measured

// Constraints for a camera: its full size, since without `resizeMode` the browser would scale it down.
const CAMERA = { width: { ideal: 4000 }, height: { ideal: 3000 }, frameRate: { ideal: 30 }, resizeMode: "none" };

// An OffscreenCanvas as the bytes of a JPEG.
export async function jpeg(canvas, quality = QUALITY) {
  const blob = await canvas.convertToBlob({ type: "image/jpeg", quality });
  return new Uint8Array(await blob.arrayBuffer());
}

// A run, from the start of a panel to its stop: the devices in use, and the actions that end it.
class Run {
  tracks = [];
  ends = [];

  // Opens a device, the chosen one if there is one; `wishes` are constraints for its kind, video or audio.
  async open(kind, deviceId, wishes) {
    const media = await navigator.mediaDevices.getUserMedia({
      [kind]: { ...(deviceId && { deviceId: { exact: deviceId } }), ...wishes },
    });
    this.tracks.push(...media.getTracks());
    return media;
  }

  async camera(deviceId) {
    const srcObject = await this.open("video", deviceId, CAMERA);
    const video = Object.assign(document.createElement("video"), { srcObject, muted: true, playsInline: true });
    await video.play();
    return video;
  }

  end() {
    this.tracks.forEach((track) => track.stop());
    for (const end of this.ends.splice(0)) end();
  }
}

// Stands in for a socket: sends messages one at a time over the page's own connection, as answers to a delivery.
function carrierFor(token, opened, answered) {
  let message;
  let again;
  const over = new AbortController();
  const socket = {
    most: 1, // message in flight
    /** @type {number} */
    readyState: WebSocket.OPEN,
    onclose: null,
    send: (item) => {
      message = { number: Date.now(), data: base64(item) };
      const send = () => received("carrier", token)?.send(message);
      again = setInterval(send, AGAIN_MS);
      send();
    },
    close: () => {
      clearInterval(again);
      socket.readyState = WebSocket.CLOSED;
      over.abort();
    },
  };
  window.addEventListener(eventOf("carrier"), () => {
    const answer = received("carrier", token);
    if (!message || answer?.number !== message.number) return;
    clearInterval(again);
    message = null;
    if (answer.end) socket.onclose({ code: answer.end });
    else answered(answer.parts[0]);
  }, over);
  setTimeout(opened);
  return socket;
}

export class LivePanel extends Panel {
  /** @type {Run} */
  running = null;
  phase = "off"; // state of the run, or how it ended: a key of the words
  error = "";
  ahead = 0; // position in the queue, 0 if not waiting
  fault = ""; // an error of the server, in words
  rates = "";
  kind = "videoinput"; // kind of its devices
  devices = [];
  chosen = ["", ""]; // identifiers of the devices in use
  wake = () => {}; // makes the panel check at once for something to send

  constructor(parent) {
    super(parent);
    this.atEnd(() => this.stop());
    this.listen("visibilitychange", () => this.render());
  }

  // To be overridden. Opens the devices of a run, and returns the source of their pictures or sound.
  /** @type {(run: Run) => Promise<any>} */
  async open(_) {}

  // To be overridden. Returns the next message as { header, parts }, or nothing if there is nothing new; its other
  // fields stay here until it is answered.
  /** @returns {Promise<any>} */
  async grab() {}

  // To be overridden. Draws the answer, its header and `parts`, to a message.
  answered(_, _message) {}

  // To be overridden. Called when the media are closed.
  stopped() {}

  begin(_) {
    if (!this.running) this.phase = "off";
  }

  // Lists the devices; the browser names them once one of them is allowed.
  async listDevices() {
    const all = (await navigator.mediaDevices?.enumerateDevices()) ?? [];
    const found = all.filter(({ kind, deviceId }) => kind === this.kind && deviceId);
    this.devices = found.map(({ deviceId, label }, at) => ({ deviceId, label: label || `Device ${at + 1}` }));
    this.schedule();
  }

  // Changes to another device.
  choose(at, deviceId) {
    this.chosen[at] = deviceId;
    this.stop();
    this.start();
  }

  async start() {
    const run = new Run();
    this.running = run;
    if (!window.isSecureContext || !navigator.mediaDevices) return this.stop("insecure");
    this.set({ phase: "asking" });
    let media;
    try {
      media = await this.open(run);
    } catch (/** @type {any} */ error) {
      if (this.running === run) this.stop(error.name in this.data.words ? error.name : "failed", error.message);
    }
    if (this.running !== run) return run.end(); // it was stopped meanwhile
    this.media = media;
    this.set({ phase: "connecting" });
    this.connect(run);
  }

  // The markup for choosing the device at a place.
  chooser(at, name, hidden, first) {
    return html`
      <select aria-label=${name} ?hidden=${hidden} @change=${({ target }) => this.choose(at, target.value)}>
        ${first ? html`<option value="" .selected=${live(this.chosen[at] === "")}>${first}</option>` : ""}
        ${this.devices.map(({ deviceId, label }) => html`
          <option value=${deviceId} .selected=${live(deviceId === this.chosen[at])}>${label}</option>`)}
      </select>`;
  }

  // The state of the run in words.
  get told() {
    const { words } = this.data;
    if (this.running && document.hidden) return words.paused;
    if (this.phase !== "on") return filled(words[this.phase], this);
    if (this.ahead) return filled(words.waiting, this);
    return this.fault || words[this.socket.most ? "carried" : "on"];
  }

  // Pictures side by side, at a scale; those of other sizes are fitted to the first.
  picture(sources, scale) {
    const wide = Math.round(scale * (sources[0].videoWidth ?? sources[0].width));
    const high = Math.round(scale * (sources[0].videoHeight ?? sources[0].height));
    const canvas = new OffscreenCanvas(wide * sources.length, high);
    sources.forEach((one, at) => canvas.getContext("2d").drawImage(one, at * wide, 0, wide, high));
    return canvas;
  }

  connect(run, carried = !this.data.address) {
    let began = false;
    const ready = () => {
      began = true;
      this.set({ phase: "on" });
      this.send(run);
    };
    const answered = (data) => {
      if (this.running !== run) return;
      if (typeof data === "string") {
        const { state, ahead } = JSON.parse(data);
        this.ahead = state === "waiting" ? ahead : 0;
        return this.render();
      }
      const item = unpacked(new Uint8Array(data));
      const message = this.sent.shift();
      this.note(message.at);
      this.wake();
      this.fault = item.error;
      if (!item.error) this.answered(item, message);
      this.render();
    };
    /** @type {any} */
    const socket = carried ? carrierFor(this.data.token, ready, answered) : socketTo(this.data, ready, answered);
    this.socket = socket;
    this.sent = [];
    this.answers = [];
    socket.onclose = ({ code }) => {
      if (this.running !== run) return;
      if (began) this.stop(String(code) in this.data.words ? String(code) : "lost");
      else this.connect(run, true);
    };
  }

  // Sends messages until the panel is stopped, never more than `IN_FLIGHT` unanswered, and none in a hidden tab. It looks
  // for new ones regularly, and at once when woken; animation frames would make the browser redraw all the time.
  async send(run) {
    const { socket } = this;
    while (this.running === run && socket.readyState === WebSocket.OPEN) {
      if (run.tracks.some(({ readyState }) => readyState === "ended")) return this.stop("unplugged");
      const message = document.hidden || this.sent.length >= (socket.most ?? IN_FLIGHT) ? null : await this.grab();
      if (message && this.running === run && socket.readyState === WebSocket.OPEN) {
        this.sent.push({ at: performance.now(), ...message });
        socket.send(packed(message.header ?? {}, message.parts));
      } else {
        await new Promise((done) => {
          this.wake = () => done(0);
          setTimeout(done, LOOK_MS);
        });
      }
    }
  }

  stop(phase = "off", error = "") {
    this.running?.end();
    this.socket?.close();
    Object.assign(this, { running: null, socket: null, media: null, phase, error, ahead: 0, fault: "", rates: "" });
    this.stopped();
    if (this.root) this.render();
  }

  // Shows the answers per second, and the median time from the grab of a frame to its answer.
  note(at) {
    const now = performance.now();
    this.answers = [...this.answers, { now, took: now - at }].slice(-KEPT);
    if (this.answers.length < 3 || now - (this.noted ?? 0) < 500) return;
    this.noted = now;
    const rate = (1000 * (this.answers.length - 1)) / (now - this.answers[0].now);
    const took = this.answers.map((one) => one.took).sort((one, other) => one - other)[this.answers.length >> 1];
    this.rates = `${rate.toFixed(rate < 10 ? 1 : 0)} a second · ${took.toFixed(0)}\u00a0ms`;
  }
}
