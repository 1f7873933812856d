// A cut of recording 1, dragged over recording 2 without server requests.

import { axis, stacked } from "../shared/dom.js";
import { clamp, shortened, total } from "../shared/numbers.js";
import { arrows } from "../shared/panel.js";
import { visitedCurve, VisitingPanel } from "../shared/visiting.js";

const PAGE = 10;

// Four strips over one axis: recording 2, the cut of recording 1, their products, and the curve of their sums.

const LEFT = 6;
const RIGHT = 58;
const STRIPS = { recording: 72, cut: 48, products: 60, curve: 110 };
const SMALL = { recording: 44, cut: 28, products: 36, curve: 68 };
const GAP = 8;
const AXIS = 36;

export default class SlidingPanel extends VisitingPanel {
  other = "normalised";

  get words() {
    const { words } = this.data;
    return { ...words, ...words[this.measurement] };
  }

  get where() {
    const sum = shortened(this.all.values[this.place], this.option ? 2 : this.example.whole ? 0 : 1);
    return `${this.words.lag} ${shortened(this.lagAt(this.place))} · ${this.words.sum} ${sum}`;
  }

  lagAt(place) {
    return this.example.lag + place * this.example.step;
  }

  measure() {
    this.all = measured(this.example, this.option);
  }

  grab(event) {
    this.pause();
    const sample = this.sampleAt(event);
    const length = this.example.cut.length;
    if (sample < this.place || sample >= this.place + length) this.move(sample - length / 2, { jump: true });
    const grip = sample - this.place;
    return { move: (moved) => this.move(this.sampleAt(moved) - grip) };
  }

  sampleAt(event) {
    return (event.clientX - this.find("svg").getBoundingClientRect().left - LEFT) / this.layout.pitch;
  }

  actions(event) {
    return {
      ...this.ends(),
      ...arrows(event, (down, right) => this.go(this.place + right - down), PAGE),
      PageDown: () => this.go(this.place - PAGE),
      PageUp: () => this.go(this.place + PAGE),
    };
  }

  // The layout of the strips for one width: their boxes and contents.
  layOut(width) {
    const { example, all, data, place } = this;
    const { recording, cut, lag, step } = example;
    const right = width - RIGHT;
    const sides = { left: LEFT, right };
    const pitch = (right - LEFT) / recording.length;
    const { boxes, height } = stacked(data.small ? SMALL : STRIPS, () => GAP);
    const x = (sample) => LEFT + (sample + 0.5) * pitch;
    const written = example.whole && pitch >= 14; // each number is written below its stem
    const around = ({ top, height }, reach) => {
      const half = (written ? height - 15 : height) / 2;
      return (value) => top + half - (value / (reach || 1)) * (half - 4);
    };
    const loudest = (values) => Math.max(...values.map(Math.abs));
    const ofRecording = around(boxes.recording, loudest(recording));
    const ofCut = around(boxes.cut, loudest(cut));
    const ofProducts = around(boxes.products, all.largest);
    const ofSum = (sum) => boxes.curve.top + 8 + ((all.high - sum) / (all.high - all.low || 1)) * (boxes.curve.height - 16);
    const products = all.products[place];
    const every = [...recording.keys()];
    const covered = every.slice(place, place + cut.length);
    const stems = (kind, samples, values, y) => ({
      kind,
      lines: samples.map((sample, index) => `M${x(sample)} ${y(0)}V${y(values[index])}`).join(""),
      dots: samples.map((sample, index) => `M${x(sample)} ${y(values[index])}h0`).join(""),
    });
    const bars = (kind, sign) => {
      const all = covered.map((sample, index) => `M${x(sample)} ${ofProducts(0)}V${ofProducts(products[index])}`);
      return { kind, d: all.filter((_, index) => sign * products[index] > 0).join("") };
    };
    const numbers = (samples, values, { bottom }) => samples.map((sample, index) => [sample, bottom - 1, values[index]]);
    const lags = { first: lag, last: lag + (recording.length - 1) * step, x: (tick) => x((tick - lag) / step) };
    return {
      ...sides, pitch, boxes, x,
      height: height - GAP + AXIS,
      zeros: { recording: ofRecording(0), cut: ofCut(0), products: ofProducts(0), curve: ofSum(0) },
      hold: { x: x(place) - pitch / 2, width: pitch * cut.length },
      stems: [
        stems("outside", every, recording, ofRecording),
        stems("inside", covered, recording.slice(place, place + cut.length), ofRecording),
        stems("cut", covered, cut, ofCut),
      ],
      ghost: `M${covered.map((sample, index) => `${x(sample)} ${ofRecording(cut[index])}`).join("L")}`,
      bars: [bars("up", 1), bars("down", -1)],
      numbers: written ? [
        ...numbers(every, recording, boxes.recording),
        ...numbers(covered, cut, boxes.cut),
        ...(products.every(Number.isInteger) ? numbers(covered, products, boxes.products) : []),
      ] : [],
      level: ofSum(all.values[place]),
      lags: axis({ ...sides, y: boxes.curve.bottom, ...lags }, data.words.axis),
      curve: visitedCurve({ ...sides, x, y: ofSum, stroke: clamp(pitch, 1.5, 2.5) }, this, data.words.perfect, 13),
    };
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
