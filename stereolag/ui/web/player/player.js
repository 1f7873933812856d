// One video contains the left picture and the maps side by side; each is shown on its own canvas, and pieces are
// appended as they are computed. Charts below show the figures of every frame and mark the current one.

import { described, element, gapped, node, shareOf } from "../shared/dom.js";
import { eventOf, received } from "../shared/exchange.js";
import { legend } from "../shared/legend.js";
import { clamp, shortened } from "../shared/numbers.js";
import { arrows, onKey, Panel, show } from "../shared/panel.js";

const WIDTH = 1000;
const HEIGHT = 48;

export default (component) => show(Player, component);

class Player extends Panel {
  constructor(parent) {
    super(parent, "player");
    this.video = this.find("video");
    this.frame = 0;
    this.awaited = null; // the frame sought but not shown yet
    this.listen(eventOf("video"), () => this.data && this.append());
    const click = (selector, act) => this.find(selector).addEventListener("click", act);
    click(".play", () => this.toggle());
    click(".back", () => this.step(-1));
    click(".on", () => this.step(1));
    click(".open", () => this.trigger("opened", this.frame));
    this.find(".scrub").addEventListener("input", ({ target }) => this.go(Number(target.value)));
    this.find(".speed").addEventListener("change", ({ target }) => (this.video.playbackRate = Number(target.value)));
    onKey(this.root, (event) => this.actions(event));
    for (const name of ["play", "pause", "ended"]) this.video.addEventListener(name, () => this.showState());
    this.video.addEventListener("play", () => (this.awaited = null));
    const draw = (_, { mediaTime }) => {
      this.showPicture(mediaTime);
      this.video.requestVideoFrameCallback(draw);
    };
    this.video.requestVideoFrameCallback(draw);
  }

  close() {
    super.close();
    this.video.pause();
    this.forget();
  }

  forget() {
    if (this.address) URL.revokeObjectURL(this.address);
    this.video.removeAttribute("src");
    this.address = this.buffer = null;
  }

  load(data) {
    const before = this.data;
    this.data = data;
    if (before?.name !== data.name) this.beginVideo();
    this.append();
    this.find(".scrub").max = data.frames - 1;
    if (JSON.stringify(before?.titles) !== JSON.stringify(data.titles)) this.layOut();
    this.find(".legends").replaceChildren(...data.legends.map(legend));
    this.drawTimeline();
    this.showFrame();
  }

  // Starts a new video: another sequence, or other settings.
  beginVideo() {
    this.forget();
    this.appended = 0;
    this.frame = 0;
    this.awaited = null;
    this.screens?.forEach((canvas) => (canvas.width = 0)); // nobody may take the pictures of another drive for these
    if (!window.MediaSource) return; // the video is then shown once complete
    this.source = new MediaSource();
    this.address = URL.createObjectURL(this.source);
    this.video.src = this.address;
    this.source.addEventListener("sourceopen", () => this.append(), { once: true });
  }

  piece(number) {
    return received("video", `${this.data.name} ${number}`)?.parts[0];
  }

  append() {
    if (!window.MediaSource) {
      this.appendAll();
      return;
    }
    if (this.source?.readyState !== "open" || this.buffer?.updating) return;
    const piece = this.piece(this.appended);
    if (piece) {
      if (!this.buffer) {
        this.buffer = this.source.addSourceBuffer(`video/mp4; codecs="${codec(piece)}"`);
        this.buffer.addEventListener("updateend", () => this.append());
      }
      this.appended += 1;
      this.buffer.appendBuffer(piece);
      if (this.appended === 2) this.go(0);
    } else if (this.data.done && this.appended === this.data.pieces) this.source.endOfStream();
  }

  appendAll() {
    const pieces = Array.from({ length: this.data.pieces }, (_, number) => this.piece(number));
    if (!this.data.done || this.address || !pieces.every(Boolean)) return;
    this.address = URL.createObjectURL(new Blob(pieces, { type: "video/mp4" }));
    this.video.src = this.address;
    this.go(0);
  }

  layOut() {
    this.screens = this.data.titles.map(() => {
      const canvas = described(element("canvas"), { role: "img" });
      canvas.style.aspectRatio = `${this.data.width} / ${this.data.height}`;
      return canvas;
    });
    this.find(".screens").replaceChildren(
      ...this.screens.map((canvas, at) => element("figure", "", element("figcaption", "", this.data.titles[at]), canvas)),
    );
  }

  // Draws the current picture of the video, each part on its own canvas.
  showPicture(time) {
    const width = this.video.videoWidth / this.screens.length;
    this.screens.forEach((canvas, index) => {
      if (canvas.width !== width) [canvas.width, canvas.height] = [width, this.video.videoHeight];
      const context = canvas.getContext("2d");
      context.drawImage(this.video, index * width, 0, width, canvas.height, 0, 0, width, canvas.height);
    });
    const frame = clamp(Math.floor(time * this.data.rate + 0.5), 0, this.data.frames - 1);
    if (this.awaited !== null && frame !== this.awaited) return; // an earlier step: the next starts from the latest
    this.awaited = null;
    this.frame = frame;
    this.showFrame();
  }

  toggle() {
    if (!this.video.paused) {
      this.video.pause();
      return;
    }
    if (this.video.ended || this.frame >= this.data.computed - 1) this.go(0);
    this.video.play().catch(() => {}); // interrupted by a pause
  }

  step(by) {
    this.video.pause();
    this.go(this.frame + by);
  }

  go(frame) {
    this.frame = this.awaited = clamp(frame, 0, Math.max(0, this.data.computed - 1));
    this.video.currentTime = (this.frame + 0.5) / this.data.rate;
    this.showFrame();
  }

  actions(event) {
    const { target, key } = event;
    if (target.matches("select, button") || (target.matches("input") && key !== " ")) return {};
    const { ArrowLeft, ArrowRight } = arrows(event, (_, frames) => this.step(frames));
    const ends = { Home: () => this.go(0), End: () => this.go(this.data.computed - 1) };
    return { " ": () => this.toggle(), ArrowLeft, ArrowRight, ...ends };
  }

  showState() {
    const button = this.find(".play");
    button.textContent = this.video.paused ? "▶" : "❚❚";
    button.setAttribute("aria-label", this.video.paused ? "Play" : "Pause");
  }

  showFrame() {
    const { rate, frames, problems } = this.data;
    this.find(".scrub").value = this.frame;
    this.find(".where").textContent = `${shortened(this.frame / rate, 1, "s")} · frame ${this.frame + 1} of ${frames}`;
    this.find(".problem").textContent = problems[this.frame];
    this.screens?.forEach((canvas, at) => canvas.setAttribute("aria-label", this.told(this.data.titles[at])));
    for (const { head, now, series, unit, digits } of this.charts ?? []) {
      head.setAttribute("d", `M${this.x(this.frame)} 0V${HEIGHT}`);
      now.replaceChildren(
        ...series.map(({ values, colour, dash, title }) => {
          const value = values[this.frame];
          const line = element("span", "", sample(colour, dash), value == null ? "–" : shortened(value, digits, unit));
          line.title = title;
          return line;
        }),
      );
    }
  }

  // The accessible label of a screen: the figures of its method at this frame.
  told(title) {
    const figures = this.data.charts.flatMap(({ name, unit, digits, series }) => {
      const value = series.find((one) => one.title === title)?.values[this.frame];
      return value == null ? [] : [`${name.toLowerCase()} ${shortened(value, digits, unit)}`];
    });
    return `${title}, frame ${this.frame + 1}${figures.length ? `: ${figures.join(", ")}` : ""}`;
  }

  x(frame) {
    return (frame / Math.max(1, this.data.frames - 1)) * WIDTH;
  }

  drawTimeline() {
    this.charts = this.data.charts.map((chart) => this.chart(chart));
    this.find(".timeline").replaceChildren(...this.charts.map(({ box }) => box));
    const drawn = this.charts.flatMap(({ series }) => series);
    this.screens.forEach((canvas, at) => {
      const title = this.data.titles[at];
      const line = drawn.find((one) => one.title === title);
      canvas.previousSibling.replaceChildren(...(line ? [sample(line.colour, line.dash)] : []), title);
    });
  }

  chart({ name, unit, digits, from_zero, series }) {
    const known = series.flatMap(({ values }) => values.filter((value) => value != null));
    const low = from_zero ? 0 : Math.min(...known);
    const high = Math.max(...known, low + 1e-9);
    const told = series.map(({ title, values }) => {
      const all = values.filter((value) => value != null);
      return `${title} ${shortened(Math.min(...all), digits)} to ${shortened(Math.max(...all), digits, unit)}`;
    });
    const label = `${name} over all frames: ${told.join(", ")}`;
    const svg = node("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", role: "img", "aria-label": label });
    for (const { values, colour, dash } of series) {
      const places = values.map((value, frame) => value == null ? null : `${this.x(frame)} ${HEIGHT - 2 - ((value - low) / (high - low)) * (HEIGHT - 6)}`);
      svg.append(node("path", { d: gapped(places), stroke: colour, "stroke-dasharray": dash }));
    }
    const head = node("path", { class: "head", d: "" });
    svg.append(head);
    svg.addEventListener("click", (event) => this.go(Math.round(shareOf(event, svg)[0] * (this.data.frames - 1))));
    const now = element("span", "now");
    const box = element("div", "chart", element("span", "name", name), svg, now);
    return { box, head, now, series, unit, digits };
  }
}

// A sample of a line of the timeline, shown beside its current value and its title.
function sample(stroke, dash) {
  return node("svg", { class: "sample", "aria-hidden": true }, node("path", { d: "M1 6H27", stroke, "stroke-dasharray": dash }));
}

// The codec string of RFC 6381, from the decoder configuration box.
function codec(piece) {
  const text = new TextDecoder("latin1").decode(piece.subarray(0, 4096));
  const at = text.indexOf("avcC") + 5;
  return "avc1." + [...piece.subarray(at, at + 3)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
