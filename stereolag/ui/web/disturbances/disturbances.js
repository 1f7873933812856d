// Sliders that disturb two recordings, and the curve of their lag; Python mixes them, measures the lag and judges it.

import { axis, plotted, stacked } from "../shared/dom.js";
import { clamp, shortened } from "../shared/numbers.js";
import { ExamplesPanel } from "../shared/visiting.js";

const EVERY_MS = 80; // between requests while a slider is dragged

// Four strips: both recordings lined up, the curve with its chance band, its peak up close, and the agreement.

const LEFT = 6;
const RIGHT = 46;
const HEIGHTS = { recordings: 56, curve: 150, close: 100, agreement: 14 };
const BELOW = { recordings: 10, curve: 40, close: 26, agreement: 22 };
const CLOSE = 60; // lags to either side of the peak

export default class DisturbancesPanel extends ExamplesPanel {
  setUp() {
    this.atEnd(() => clearTimeout(this.sending));
  }

  // Starts with the first example, then shows one answer after the other.
  begin(data) {
    if (this.settings) return;
    this.asked = JSON.stringify(data.settings);
    super.begin(data);
  }

  choose(example) {
    this.change({ ...this.data.start, ...example.settings });
    super.choose(example);
  }

  change(settings) {
    this.chosen = null;
    this.settings = { ...this.settings, ...settings };
    this.sending ??= setTimeout(() => this.ask(), EVERY_MS);
    this.schedule();
  }

  // Sends the current settings, however many changes there were since the last time.
  ask() {
    this.sending = undefined;
    const asked = JSON.stringify(this.settings);
    if (asked === this.asked) return;
    this.asked = asked;
    this.setState("settings", this.settings);
  }

  told(name, low, unit) {
    const value = this.settings[name];
    return `${low < 0 && value > 0 ? "+" : ""}${shortened(value, 0, unit)}`;
  }

  layOut(width) {
    const { data } = this;
    const { curve, ribbon, peak, words } = data;
    const right = width - RIGHT;
    const { boxes, height } = stacked(HEIGHTS, (name) => BELOW[name]);
    const reach = (curve.length - 1) / 2;
    const whole = { first: -reach, last: reach, low: Math.min(-0.12, ...curve), high: 1.05 };
    const first = clamp(peak - CLOSE, -reach, reach - 2 * CLOSE);
    const near = curve.slice(first + reach, first + 2 * CLOSE + reach + 1);
    const band = ribbon ?? [0, 0];
    const [low, high] = [Math.min(1.2 * band[0], ...near), 1.15 * Math.max(band[1], ...near)];
    const close = { first, last: first + 2 * CLOSE, low, high };
    return {
      height, boxes, left: LEFT, right,
      recordings: data.recordings.map((part) => plotted(part)),
      curves: [curveIn(boxes.curve, right, whole, data, words.axis), curveIn(boxes.close, right, close, data)],
      agreement: data.agreement.map((share) => LEFT + share * (right - LEFT)),
    };
  }
}

// The curve between two lags and two values, in a box.
function curveIn({ height, bottom }, right, { first, last, low, high }, { curve, ribbon, peak, rivals, verdict }, label = "") {
  const x = (lag) => LEFT + ((lag - first) / (last - first)) * (right - LEFT);
  const y = (value) => bottom - ((clamp(value, low, high) - low) / (high - low)) * height;
  const valueAt = (lag) => curve[lag + (curve.length - 1) / 2];
  const lags = Array.from({ length: last - first + 1 }, (_, at) => first + at);
  const peaks = { kind: verdict === "nothing" ? "peak doubtful" : "peak", lag: peak, r: 7 };
  const marks = [...rivals.map((lag) => ({ kind: "rival", lag, r: 5 })), peaks];
  return {
    x,
    zero: y(0),
    ribbon: ribbon?.map(y) ?? "",
    middle: y(ribbon ? (ribbon[0] + ribbon[1]) / 2 : 0),
    d: `M${lags.map((lag) => [x(lag), y(valueAt(lag))]).join("L")}`,
    stroke: last - first > right ? 1 : 2,
    marks: marks.filter(({ lag }) => lag >= first && lag <= last).map((mark) => ({ ...mark, x: x(mark.lag), y: y(valueAt(mark.lag)) })),
    peak: { y: y(valueAt(peak)), value: valueAt(peak) },
    axis: axis({ first, last, left: LEFT, right, y: bottom, x }, label),
  };
}
