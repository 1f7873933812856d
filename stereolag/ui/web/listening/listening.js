// Two microphones heard live: how loud they are, their waveforms, the lag that the server finds, and where it points.

import { button, described, element, line, say, sized } from "../shared/dom.js";
import { branch } from "../shared/hyperbola.js";
import { devices, LivePanel } from "../shared/live.js";
import { clamp, filled } from "../shared/numbers.js";
import { show } from "../shared/panel.js";
import { joined, listening } from "./pieces.js";

const PIECE_S = 0.18; // of sound in a message, at least: with the rest of a block, five messages a second
const KEPT_S = 2; // of sound that is drawn, and that the server keeps
const COLUMN = 256; // samples that are drawn as one line
const LOWEST_DB = -60;
const QUIETEST = 0.02; // of full scale: what is quieter is drawn as small as it is
const HIGH = 150;
const NEEDLE = 100;

export default (component) => show(Listening, component);

class Listening extends LivePanel {
  constructor(parent) {
    super(parent, "listening");
    this.svg = this.find("svg");
    this.canvases = [];
    this.choices = [0, 1].map(() => element("select"));
    for (const one of this.choices) one.addEventListener("change", () => this.changed());
    this.apart = described(element("input"), { type: "number", min: "0.01", step: "0.05", value: "0.5" });
    this.apart.addEventListener("input", () => this.point());
    this.freeze = Object.assign(button("", () => this.keep()), { hidden: true });
    this.find(".rates").before(...this.choices, this.freeze);
    this.forget();
    this.watchSize(this.root);
    navigator.mediaDevices?.addEventListener?.("devicechange", () => this.running && this.list(), { signal: this.gone.signal });
  }

  begin(data) {
    super.begin(data);
    const { words, colours } = data;
    this.colour(colours);
    this.freeze.textContent = words.freeze;
    this.find(".place label").replaceChildren(words.apart, this.apart, "m");
    const rows = [1, 2].flatMap((number) => {
      const name = filled(words.sensor, { number });
      this.choices[number - 1].setAttribute("aria-label", name);
      const level = element("i");
      level.style.background = colours[`sensor-${number}`];
      const canvas = described(element("canvas"), { "aria-hidden": true });
      return [element("span", "", name), element("div", "level", level), canvas];
    });
    this.find(".heard").replaceChildren(...rows);
    this.canvases = this.findAll("canvas");
    this.levels = this.findAll(".level i");
    this.list();
    this.draw();
  }

  // Offers the devices; the browser names them once one of them is allowed.
  async list() {
    const all = this.running ? await devices("audioinput") : [];
    const options = all.map(({ deviceId, label }) => Object.assign(element("option", "", label), { value: deviceId }));
    this.choices.forEach((choice, at) => {
      const before = choice.value;
      const first = at ? [Object.assign(element("option", "", this.data.words.same), { value: "" })] : [];
      choice.replaceChildren(...first, ...options.map((one) => one.cloneNode(true)));
      choice.value = before || choice.options[0]?.value || "";
      choice.hidden = !this.running || !options.length;
    });
  }

  // Asks the server to keep what is heard now; once it has, the page takes it as its recordings.
  keep() {
    this.freeze.textContent = this.data.words.frozen;
    this.asked = Date.now();
  }

  changed() {
    this.stop();
    this.start();
  }

  forget() {
    this.collected = [];
    this.columns = [];
    this.latest = null;
  }

  /** @returns {Promise<any>} */
  async open() {
    this.forget();
    const [first, second] = this.choices.map(({ value }) => value);
    const chosen = second && second !== first ? [first, second] : [first];
    this.devices = chosen.length;
    this.begun = Date.now();
    const media = await listening(chosen, (...block) => this.take(block));
    queueMicrotask(() => this.list());
    return media;
  }

  stopped() {
    this.freeze.hidden = true;
    for (const choice of this.choices) choice.hidden = true;
    for (const level of this.levels ?? []) level.style.width = "0";
    this.showOld();
  }

  // Takes a block of both channels, and draws it.
  take(block) {
    if (!this.running) return;
    this.collected.push(block);
    const length = block[0].length;
    const kept = KEPT_S * (this.media?.rate ?? 48_000);
    this.collected.splice(0, this.collected.length - Math.ceil(kept / length));
    for (let at = 0; at < length; at += COLUMN) {
      this.columns.push(block.map((samples) => {
        const part = samples.subarray(at, at + COLUMN);
        return [Math.min(...part) / 32768, Math.max(...part) / 32768];
      }));
    }
    this.most = Math.ceil(kept / COLUMN);
    this.columns.splice(0, this.columns.length - this.most);
    block.forEach((samples, at) => {
      const decibels = 10 * Math.log10(samples.reduce((sum, one) => sum + one ** 2, 1) / length / 32768 ** 2);
      this.levels[at].style.width = `${100 * clamp(1 - decibels / LOWEST_DB, 0, 1)}%`;
    });
    this.schedule();
  }

  async grab() {
    const count = this.collected.length * (this.collected[0]?.[0].length ?? 0);
    const { rate } = this.media;
    if (count < PIECE_S * rate) return null;
    const parts = joined(this.collected, Math.round(KEPT_S * rate));
    this.collected = [];
    const header = { rate, devices: this.devices, begun: this.begun, freeze: this.asked };
    this.asked = undefined;
    return { header, parts };
  }

  // Shows a lag and where it points; one that is no longer heard stays, faint.
  answered({ sure, lag, difference, said, frozen }) {
    this.freeze.hidden = false;
    if (frozen) this.trigger("freeze", frozen);
    say(this.find(".said"), said);
    this.find(".place").hidden = this.devices > 1;
    if (!sure) return this.showOld();
    this.find(".lag .number").textContent = lag;
    this.find(".lag .number + span").textContent = this.data.words.samples;
    this.difference = difference;
    this.showOld(false);
    this.point();
  }

  showOld(old = true) {
    for (const one of [this.find(".lag"), this.svg]) one.classList.toggle("before", old);
  }

  draw() {
    this.canvases.forEach((canvas, at) => this.drawWave(canvas, this.columns.map((both) => both[at]), at + 1));
    this.point();
  }

  drawWave(canvas, columns, number) {
    const { clientWidth, clientHeight } = canvas;
    const ratio = window.devicePixelRatio;
    const [width, height] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const context = canvas.getContext("2d");
    context.clearRect(0, 0, width, height);
    const highest = columns.reduce((most, [low, high]) => Math.max(most, high, -low), QUIETEST);
    const step = width / (this.most ?? 1);
    const y = (value) => (height / 2) * (1 - value / highest);
    context.fillStyle = this.data.colours[`sensor-${number}`];
    columns.forEach(([low, high], at) => {
      const x = Math.round(width - (columns.length - at) * step);
      context.fillRect(x, y(high), Math.ceil(step), Math.max(y(low) - y(high), ratio));
    });
  }

  // Draws both sensors, every place with the path difference, and a needle along them.
  point() {
    const width = this.svg.clientWidth;
    if (!width || !this.data) return;
    const difference = this.difference ?? 0;
    const apart = Math.max(Number(this.apart.value) || 0.01, Math.abs(difference));
    const scale = width / 4 / apart;
    const [middle, floor] = [width / 2, HIGH - 24];
    const add = sized(this.svg, width, HIGH);
    add("path", { class: "line", d: `M0 ${floor}H${width}` });
    if (this.difference !== undefined) {
      const places = branch(difference, apart, 4 * apart).filter(([, y]) => y >= 0);
      add("path", { class: "same", d: line(places.map(([x, y]) => [middle + x * scale, floor - y * scale])) });
      const turn = -Math.asin(difference / apart);
      const [x, y] = [middle + NEEDLE * Math.sin(turn), floor - NEEDLE * Math.cos(turn)];
      add("path", { class: "needle", d: line([[middle, floor], [x, y]]) });
      add("circle", { class: "hub", cx: middle, cy: floor, r: 6 });
    }
    [-1, 1].forEach((side, at) => {
      const x = middle + (side * apart * scale) / 2;
      add("circle", { class: `sensor-${at + 1}`, cx: x, cy: floor, r: 7 });
      add("text", { x, y: floor + 21 }, filled(this.data.words.sensor, { number: at + 1 }));
    });
  }
}
