// A cut of recording 1, dragged over recording 2 without server requests.

import { described, drawAxis, sized, stacked } from "../shared/dom.js";
import { clamp, shortened, total } from "../shared/numbers.js";
import { arrows, onDrag, onKey, show } from "../shared/panel.js";
import { drawVisited, VisitingPanel } from "../shared/visiting.js";

const PAGE = 10;

export default (component) => show(SlidingPanel, component);

class SlidingPanel extends VisitingPanel {
  constructor(parent) {
    super(parent);
    this.svg = this.find("svg");
    this.find(".normalise").addEventListener("change", () => this.measure());
    onDrag(this.stage, (event) => this.grab(event));
    onKey(this.stage, (event) => this.actions(event));
  }

  prepare() {
    const { recording, cut, lag, step } = this.example;
    this.root.classList.toggle("small", this.data.small);
    described(this.stage, { "aria-valuemin": lag, "aria-valuemax": lag + (recording.length - cut.length) * step });
    this.find(".normalise").checked = false;
  }

  measure() {
    this.normalised = this.find(".normalise").checked;
    this.all = measured(this.example, this.normalised);
    this.schedule();
  }

  grab(event) {
    if (!this.at) return null;
    this.pause();
    const sample = this.sampleAt(event);
    const length = this.example.cut.length;
    if (sample < this.place || sample >= this.place + length) this.move(sample - length / 2, { jump: true });
    const grip = sample - this.place;
    return { move: (moved) => this.move(this.sampleAt(moved) - grip) };
  }

  sampleAt(event) {
    return (event.clientX - this.svg.getBoundingClientRect().left - LEFT) / this.at.pitch;
  }

  actions(event) {
    const go = (place, how = {}) => {
      this.pause();
      this.move(place, how);
    };
    return {
      ...arrows(event, (down, right) => go(this.place + right - down), PAGE),
      PageDown: () => go(this.place - PAGE),
      PageUp: () => go(this.place + PAGE),
      Home: () => go(0, { jump: true }),
      End: () => go(this.visited.length - 1, { jump: true }),
      " ": () => this.toggle(),
    };
  }

  draw() {
    if (!this.all || !this.svg.clientWidth) return;
    const { words } = this.data;
    const { example, all, place } = this;
    const named = { ...words, ...(this.normalised ? words.normalised : words.plain) };
    this.at = drawStrips(this.svg, this, named);
    const sum = shortened(all.values[place], this.normalised ? 2 : example.whole ? 0 : 1);
    const lag = example.lag + place * example.step;
    const said = `${words.lag} ${shortened(lag)} · ${named.sum} ${sum}`;
    described(this.stage, { "aria-valuenow": lag, "aria-valuetext": said });
    this.tell(said, example.said[this.normalised ? "normalised" : "plain"]);
  }
}

// The products at one place, and their sum.

// The products of the cut with the samples under it. Normalised, both are centred and divided by their length as
// vectors, so that the sum is Pearson's correlation; constant values give zeros.
function productsAt(recording, cut, place, normalise) {
  const under = recording.slice(place, place + cut.length);
  const [first, second] = normalise ? [standardised(cut), standardised(under)] : [cut, under];
  return first.map((value, index) => value * second[index]);
}

function standardised(values) {
  const mean = total(values) / values.length;
  const centred = values.map((value) => value - mean);
  const length = Math.hypot(...centred);
  return centred.map((value) => (length > 1e-9 ? value / length : 0));
}

// Everything drawn for one example: products and sum (the value) at each place, and the sum of a perfect match.
export function measured({ recording, cut }, normalise) {
  const places = recording.length - cut.length + 1;
  const products = Array.from({ length: places }, (_, place) => productsAt(recording, cut, place, normalise));
  const values = products.map(total);
  const perfect = normalise ? 1 : total(cut.map((value) => value * value));
  const low = normalise ? -1 : Math.min(0, ...values);
  const top = Math.max(...values);
  const high = Math.max(perfect, top);
  const peaks = values.flatMap((sum, place) => (top - sum < 1e-3 * (high - low) ? [place] : []));
  const largest = Math.max(...products.flat().map(Math.abs));
  return { products, values, perfect, peaks, low, high, largest };
}

// Four strips over one axis: recording 2, the cut of recording 1, their products, and the curve of their sums.

const LEFT = 6;
const RIGHT = 58;
const NAME = 20; // px for the name above each strip
const STRIPS = { recording: 72, cut: 48, products: 60, curve: 110 };
const SMALL = { recording: 44, cut: 28, products: 36, curve: 68 };
const GAP = 8;
const AXIS = 36;

// The layout of the strips for one width: their boxes, and the functions that map samples and values to px.
function laidOut(width, { example, all, data }) {
  const { recording, cut } = example;
  const pitch = (width - LEFT - RIGHT) / recording.length;
  const { boxes, height: end } = stacked(data.small ? SMALL : STRIPS, NAME, () => GAP);
  const x = (sample) => LEFT + (sample + 0.5) * pitch;
  const written = example.whole && pitch >= 14; // each number is written below its stem
  const around = ({ top, height }, reach) => {
    const half = (written ? height - 15 : height) / 2;
    return (value) => top + half - (value / (reach || 1)) * (half - 4);
  };
  const loudest = (values) => Math.max(...values.map(Math.abs));
  const { top, height } = boxes.curve;
  return {
    width, pitch, boxes, x, written,
    height: end - GAP + AXIS,
    ofRecording: around(boxes.recording, loudest(recording)),
    ofCut: around(boxes.cut, loudest(cut)),
    ofProducts: around(boxes.products, all.largest),
    ofSum: (sum) => top + 8 + ((all.high - sum) / (all.high - all.low || 1)) * (height - 16),
  };
}

function drawStrips(svg, panel, words) {
  const { example, all, place } = panel;
  const at = laidOut(svg.clientWidth, panel);
  const { x, pitch, boxes, width } = at;
  const { recording, cut } = example;
  const covered = [...cut.keys()].map((index) => place + index);
  const add = sized(svg, at.width, at.height);
  const stems = (kind, samples, values, y) => {
    const d = samples.map((sample, index) => `M${x(sample)} ${y(0)}V${y(values[index])}`);
    const dots = samples.map((sample, index) => `M${x(sample)} ${y(values[index])}h0`);
    add("path", { class: kind, "stroke-width": clamp(pitch * 0.4, 1, 2), d: d.join("") });
    add("path", { class: kind, "stroke-width": clamp(pitch * 0.8, 1, 8), d: dots.join("") });
  };

  for (const [name, { top, bottom }] of Object.entries(boxes)) {
    add("text", { x: LEFT, y: top - 6, class: "name" }, words[name]);
    const zero = { recording: at.ofRecording, cut: at.ofCut, products: at.ofProducts, curve: at.ofSum }[name](0);
    add("path", { class: "zero", d: `M${LEFT} ${Math.min(zero, bottom)}H${width - RIGHT}` });
  }

  const first = x(place) - pitch / 2;
  const hold = { class: "hold", x: first, width: pitch * cut.length, rx: 5 };
  add("rect", { ...hold, y: boxes.recording.top, height: boxes.cut.bottom - boxes.recording.top });
  const others = [...recording.keys()].filter((sample) => sample < place || sample >= place + cut.length);
  const heard = (samples) => samples.map((sample) => recording[sample]);
  stems("outside", others, heard(others), at.ofRecording);
  stems("inside", covered, heard(covered), at.ofRecording);
  add("path", { class: "ghost", d: `M${covered.map((sample, index) => `${x(sample)} ${at.ofRecording(cut[index])}`).join("L")}` });
  stems("cut", covered, cut, at.ofCut);

  const products = all.products[place];
  for (const [kind, sign] of Object.entries({ up: 1, down: -1 })) {
    const bars = covered.map((sample, index) => `M${x(sample)} ${at.ofProducts(0)}V${at.ofProducts(products[index])}`);
    const d = bars.filter((_, index) => sign * products[index] > 0).join("");
    add("path", { class: kind, "stroke-width": Math.max(1, pitch * 0.7), d });
  }
  if (at.written) {
    const write = (samples, values, y) =>
      samples.forEach((sample, index) =>
        add("text", { x: x(sample), y: y(values[index]), class: "small", "text-anchor": "middle" }, shortened(values[index], 0)),
      );
    write([...recording.keys()], recording, () => boxes.recording.bottom - 1);
    write(covered, cut, () => boxes.cut.bottom - 1);
    if (products.every(Number.isInteger)) write(covered, products, () => boxes.products.bottom - 1);
  }

  const now = all.values[place];
  add("path", { class: "guide", d: `M${x(place)} ${boxes.cut.bottom}V${boxes.curve.bottom}` });
  add("path", { class: "level", d: `M${x(place)} ${at.ofSum(now)}H${width - RIGHT + 20}` });
  const strip = { left: LEFT, right: width - RIGHT, x, y: at.ofSum, stroke: clamp(pitch, 1.5, 2.5) };
  drawVisited(add, strip, panel, words.perfect, 13);
  drawThermometer(add, at, now);
  const { lag, step } = example;
  const lags = { first: lag, last: lag + (recording.length - 1) * step, x: (tick) => x((tick - lag) / step) };
  drawAxis(add, { left: LEFT, right: width - RIGHT, y: boxes.curve.bottom, ...lags }, words.axis);
  return at;
}

// As tall as the curve, so that its level is at the height of the current point of the curve.
function drawThermometer(add, at, sum) {
  const { top, bottom } = at.boxes.curve;
  const x = at.width - RIGHT + 20;
  const [level, zero] = [at.ofSum(sum), at.ofSum(0)];
  add("rect", { class: "tube", x, y: top, width: 16, height: bottom - top, rx: 8 });
  add("rect", {
    class: sum < 0 ? "mercury below" : "mercury", x: x + 3, y: Math.min(level, zero), width: 10, height: Math.abs(level - zero), rx: 2,
  });
  add("path", { class: "zero", d: `M${x - 4} ${zero}h24` });
  add("text", { x: x + 24, y: zero + 4, class: "small faint" }, "0");
}
