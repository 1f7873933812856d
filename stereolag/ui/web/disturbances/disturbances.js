// Sliders that disturb two recordings, and the curve of their lag; Python mixes them, measures the lag and judges it.

import { described, drawAxis, element, line, say, sized, stacked } from "../shared/dom.js";
import { clamp, shortened } from "../shared/numbers.js";
import { show } from "../shared/panel.js";
import { ExamplesPanel } from "../shared/visiting.js";

const EVERY_MS = 80; // while a slider is dragged

export default (component) => show(DisturbancesPanel, component);

class DisturbancesPanel extends ExamplesPanel {
  constructor(parent) {
    super(parent, "disturbances");
    this.svg = this.find("svg");
    this.other = this.find(".other");
    this.other.addEventListener("click", () => this.change({ draw: this.settings.draw + 1 }));
    this.watchSize(this.find(".drawing"));
  }

  close() {
    super.close();
    clearTimeout(this.sending);
  }

  // Begins with the first example, and then shows one answer after the other.
  begin(data) {
    if (!this.settings) {
      this.asked = JSON.stringify(data.settings);
      this.find(".sliders").replaceChildren(...data.sliders.map((slider) => this.slider(slider)), this.other);
      super.begin(data);
    }
    const { kind, ...said } = data.said;
    for (const [place, text] of Object.entries(said)) say(this.find(`.${place}`), text);
    this.find(".verdict").className = `verdict ${kind}`;
    this.schedule();
  }

  slider({ name, title, meaning, low, high, step }) {
    const input = Object.assign(element("input"), { type: "range", name, min: low, max: high, step });
    input.addEventListener("input", () => this.change({ [name]: Number(input.value) }));
    described(input, { "aria-label": title, "aria-description": meaning });
    return Object.assign(element("label", "", title, element("output"), input), { title: meaning });
  }

  choose(example) {
    this.change({ ...this.data.start, ...example.settings });
    super.choose(example);
  }

  change(settings) {
    this.showExample(null);
    this.settings = { ...this.settings, ...settings };
    for (const { name, low, unit } of this.data.sliders) {
      const input = this.find(`input[name=${name}]`);
      const value = this.settings[name];
      const said = `${low < 0 && value > 0 ? "+" : ""}${shortened(value, 0, unit)}`;
      input.value = value;
      input.setAttribute("aria-valuetext", said);
      input.previousElementSibling.textContent = said;
    }
    this.find("input[name=period]").disabled = !this.settings.repetition;
    this.sending ??= setTimeout(() => this.ask(), EVERY_MS);
  }

  // Sends the settings as they are now, however many changes there were since the last time.
  ask() {
    this.sending = undefined;
    const asked = JSON.stringify(this.settings);
    if (asked === this.asked) return;
    this.asked = asked;
    this.setState("settings", this.settings);
  }

  draw() {
    if (this.svg.clientWidth) drawDisturbed(this.svg, this.data);
  }
}

// Four strips: both recordings lined up, the curve with its chance band, its peak up close, and the agreement.

const LEFT = 6;
const RIGHT = 46;
const NAME = 20; // px for the name above each strip
const HEIGHTS = { recordings: 56, curve: 150, close: 100, agreement: 14 };
const BELOW = { recordings: 10, curve: 40, close: 26, agreement: 22 };
const CLOSE = 60; // lags to either side of the peak
const MOST_AGREEMENT = 100;

function drawDisturbed(svg, data) {
  const { curve, ribbon, peak, lag, words } = data;
  const right = svg.clientWidth - RIGHT;
  const { boxes, height } = stacked(HEIGHTS, NAME, (name) => BELOW[name]);
  const add = sized(svg, svg.clientWidth, height);
  for (const [name, { top }] of Object.entries(boxes)) add("text", { x: LEFT, y: top - 6, class: "name" }, words[name]);
  drawLinedUp(add, right, boxes.recordings, data.recordings);
  const reach = (curve.length - 1) / 2;
  const whole = strip(right, boxes.curve, { first: -reach, last: reach, low: Math.min(-0.12, ...curve), high: 1.05 });
  drawCurve(add, whole, data);
  add("path", { class: "true", d: `M${whole.x(lag)} ${boxes.curve.bottom + 1}l5 9h-10z` });
  drawAxis(add, { ...whole, y: boxes.curve.bottom }, words.axis);
  const first = clamp(peak - CLOSE, -reach, reach - 2 * CLOSE);
  const last = first + 2 * CLOSE;
  const near = curve.slice(first + reach, last + reach + 1);
  const band = ribbon ?? [0, 0];
  const [low, high] = [Math.min(1.2 * band[0], ...near), 1.15 * Math.max(band[1], ...near)];
  const close = strip(right, boxes.close, { first, last, low, high });
  drawCurve(add, close, data);
  drawAxis(add, { ...close, y: boxes.close.bottom });
  drawAgreement(add, right, boxes.agreement, data);
}

function strip(right, { height, bottom }, { first, last, low, high }) {
  const x = (lag) => LEFT + ((lag - first) / (last - first)) * (right - LEFT);
  const y = (value) => bottom - ((clamp(value, low, high) - low) / (high - low)) * height;
  return { first, last, left: LEFT, right, x, ofValue: y };
}

function drawLinedUp(add, right, { top, height }, recordings) {
  recordings.forEach((part, number) => {
    const loudest = Math.max(...part.map(Math.abs));
    const pitch = (right - LEFT) / part.length;
    const points = part.map((value, i) => [LEFT + i * pitch, top + height / 2 - ((value / loudest) * height) / 2]);
    add("path", { class: ["first", "second"][number], d: line(points) });
  });
}

function drawCurve(add, { first, last, left, right, x, ofValue }, { curve, ribbon, peak, rivals, verdict, words }) {
  const valueAt = (lag) => curve[lag + (curve.length - 1) / 2];
  const middle = ofValue(ribbon ? (ribbon[0] + ribbon[1]) / 2 : 0);
  if (ribbon) {
    const [low, high] = ribbon.map(ofValue);
    add("rect", { class: "ribbon", x: left, width: right - left, y: high, height: low - high });
    add("text", { x: right + 4, y: middle + 4, class: "small faint" }, words.chance);
  }
  add("path", { class: "zero", d: `M${left} ${ofValue(0)}H${right}` });
  const lags = Array.from({ length: last - first + 1 }, (_, at) => first + at);
  const d = line(lags.map((lag) => [x(lag), ofValue(valueAt(lag))]));
  add("path", { class: "curve", "stroke-width": last - first > right ? 1 : 2, d });
  const mark = (kind, lag, r) => {
    if (lag >= first && lag <= last) add("circle", { class: kind, cx: x(lag), cy: ofValue(valueAt(lag)), r });
  };
  for (const rival of rivals) mark("rival", rival, 5);
  mark(verdict === "nothing" ? "peak doubtful" : "peak", peak, 7);
  const y = ofValue(valueAt(peak));
  if (!ribbon || Math.abs(y - middle) > 12) add("text", { x: right + 4, y: y + 4, class: "small" }, shortened(valueAt(peak), 2));
}

// Standard deviations on a logarithmic scale, with marks for the level of chance and the convincing level.
function drawAgreement(add, right, { top, height, bottom }, { evidence, chance, needed, words }) {
  const x = (deviations) => LEFT + (Math.log(clamp(deviations, 1, MOST_AGREEMENT)) / Math.log(MOST_AGREEMENT)) * (right - LEFT);
  add("rect", { class: "tube", x: LEFT, y: top, width: right - LEFT, height, rx: 4 });
  add("rect", { class: "ribbon", x: LEFT, y: top, width: x(chance) - LEFT, height });
  const kind = evidence < needed ? "evidence short" : "evidence";
  add("rect", { class: kind, x: LEFT, y: top + 3, width: x(evidence) - LEFT, height: height - 6, rx: 3 });
  add("path", { class: "limit", d: `M${x(needed)} ${top - 2}V${bottom + 4}` });
  add("text", { x: x(chance) - 6, y: bottom + 15, class: "small faint", "text-anchor": "end" }, words.chance);
  add("text", { x: x(needed), y: bottom + 15, class: "small faint" }, `${shortened(needed, 1)} ${words.convinces}`);
  add("text", { x: right + 4, y: bottom - 3, class: "small" }, shortened(evidence, 1));
}
