// Sliders that disturb two recordings, and the verdict on their lag: all computed here, without server requests.

import { drawAxis, element, line, say, sized, stacked } from "../shared/dom.js";
import { clamp, filled, shortened } from "../shared/numbers.js";
import { show } from "../shared/panel.js";
import { ExamplesPanel } from "../shared/visiting.js";
import { mixed, withSamples } from "./mixing.js";
import { judged } from "./verdict.js";

const WIDE = 0.3; // noise alone never makes the chance band this high

export default (component) => show(DisturbancesPanel, component);

class DisturbancesPanel extends ExamplesPanel {
  constructor(parent) {
    super(parent, "disturbances");
    this.svg = this.find("svg");
    this.other = this.find(".other");
    this.other.addEventListener("click", () => this.change({ draw: this.settings.draw + 1 }));
    this.watchSize(this.find(".drawing"));
  }

  begin(data) {
    this.parts = withSamples(data.parts);
    this.find(".sliders").replaceChildren(...data.sliders.map((slider) => this.slider(slider)), this.other);
    super.begin(data);
  }

  slider({ name, title, low, high, step }) {
    const meaning = this.data.words.sliders[name];
    const input = Object.assign(element("input"), { type: "range", name, min: low, max: high, step });
    input.addEventListener("input", () => this.change({ [name]: Number(input.value) }));
    input.setAttribute("aria-label", title);
    input.setAttribute("aria-description", meaning);
    return Object.assign(element("label", "", title, element("output"), input), { title: meaning });
  }

  choose(example) {
    this.change({ ...this.data.start, ...example.settings, draw: 0 });
    super.choose(example);
  }

  change(settings) {
    this.showExample(null);
    this.settings = { ...this.settings, ...settings };
    this.judgement = undefined;
    for (const { name, signed, unit } of this.data.sliders) {
      const input = this.find(`input[name=${name}]`);
      const value = this.settings[name];
      const said = `${signed && value > 0 ? "+" : ""}${shortened(value, 0, unit)}`;
      input.value = value;
      input.setAttribute("aria-valuetext", said);
      input.previousElementSibling.textContent = said;
    }
    this.find("input[name=period]").disabled = !this.settings.repetition;
    this.schedule();
  }

  draw() {
    if (!this.settings || !this.svg.clientWidth) return;
    if (!this.judgement) {
      const { repetition, echo } = this.settings;
      this.recordings = mixed(this.parts, { ...this.settings, repetition: repetition / 100, echo: echo / 100 });
      const [first, second] = this.recordings;
      this.judgement = judged(first, second, this.data.reach);
      this.tell();
    }
    const { recordings, judgement, data } = this;
    drawDisturbed(this.svg, { recordings, judgement, lag: data.parts.lag, words: data.words });
  }

  tell() {
    const { judgement, settings, data } = this;
    const { words } = data;
    const { drift, rivals } = judgement;
    const key = saidOf(judgement, settings, data.parts.lag);
    const numbers = {
      lag: shortened(judgement.lag),
      true: shortened(data.parts.lag),
      delay: shortened(data.parts.echo_delay),
      period: shortened(settings.period),
      spacing: shortened(judgement.spacing ?? 0),
      rivals: rivals.length > 1 ? filled(words.others, { count: rivals.length }) : filled(words.another, { lag: shortened(rivals[0] ?? 0) }),
      from: shortened(drift?.start ?? 0, 1),
      to: shortened(drift ? drift.start + drift.span : 0, 1),
      searched: shortened(judgement.curve.length),
      evidence: shortened(judgement.evidence, 1),
      needed: shortened(judgement.needed, 1),
    };
    const verdict = this.find(".verdict");
    verdict.className = `verdict ${key === "wrong" ? "fooled" : judgement.verdict}`;
    say(verdict, filled(words.verdicts[key], numbers));
    this.find(".numbers").textContent = filled(words.numbers, numbers);
    const notes = notesOf(judgement, settings, data.parts).map((name) => words.notes[name]);
    this.find(".said").textContent = filled([words.lessons[key], ...notes].join(" "), numbers);
  }
}

// The reason of the verdict, or "wrong" if it is sure of a lag that is not the true one.
function saidOf({ verdict, reason, lag }, { drift }, trueLag) {
  return verdict === "sure" && Math.abs(lag - trueLag) > drift / 2 + 2 ? "wrong" : reason;
}

// The notes to show: a band widened by teeth, or an echo or teeth that rise above chance around a sure peak.
function notesOf({ verdict, curve, ribbon, lag }, { echo, repetition, period }, { lag: trueLag, echo_delay: delay }) {
  const reach = (curve.length - 1) / 2;
  const wide = ribbon[1] > Math.max(WIDE, curve[lag + reach] / 2);
  if (verdict === "ambiguous" && wide) return ["wide"];
  if (verdict !== "sure" || lag !== trueLag) return [];
  const standsOut = (away) => curve[lag + away + reach] > ribbon[1];
  return [...(echo && standsOut(delay) ? ["echo"] : []), ...(repetition && standsOut(-period) && standsOut(period) ? ["teeth"] : [])];
}

// Four strips: both recordings lined up, the curve with its chance band, its peak up close, and the agreement.

const LEFT = 6;
const RIGHT = 40;
const NAME = 20; // px for the name above each strip
const HEIGHTS = { recordings: 56, curve: 150, close: 100, agreement: 14 };
const BELOW = { recordings: 10, curve: 40, close: 26, agreement: 22 };
const SHOWN = { first: 3000, samples: 240, about: 60 };
const MOST_AGREEMENT = 100;

function drawDisturbed(svg, { recordings, judgement, lag: trueLag, words }) {
  const width = svg.clientWidth;
  const { boxes, height } = stacked(HEIGHTS, NAME, (name) => BELOW[name]);
  const add = sized(svg, width, height);
  for (const [name, { top }] of Object.entries(boxes)) add("text", { x: LEFT, y: top - 6, class: "name" }, words[name]);
  drawLinedUp(add, width, boxes.recordings, recordings, judgement.lag);
  const { curve } = judgement;
  const reach = (curve.length - 1) / 2;
  const low = Math.min(-0.12, ...curve);
  const whole = strip(width, boxes.curve, { first: -reach, last: reach, low, high: 1.05 });
  drawCurve(add, whole, judgement, words);
  const at = whole.x(trueLag);
  add("path", { class: "true", d: `M${at} ${boxes.curve.bottom + 1}l5 9h-10z` });
  drawAxis(add, { ...whole, y: boxes.curve.bottom }, words.axis);
  const first = clamp(judgement.lag - SHOWN.about, -reach, reach - 2 * SHOWN.about);
  const last = first + 2 * SHOWN.about;
  const near = curve.slice(first + reach, last + reach + 1);
  const high = 1.15 * Math.max(judgement.ribbon[1], ...near);
  const close = strip(width, boxes.close, { first, last, low: Math.min(1.2 * judgement.ribbon[0], ...near), high });
  drawCurve(add, close, judgement, words);
  drawAxis(add, { ...close, y: boxes.close.bottom });
  drawAgreement(add, width, boxes.agreement, judgement, words);
}

function strip(width, { top, height, bottom }, { first, last, low, high }) {
  const right = width - RIGHT;
  const x = (lag) => LEFT + ((lag - first) / (last - first)) * (right - LEFT);
  const y = (value) => bottom - ((value - low) / (high - low)) * height;
  return { first, last, left: LEFT, right, top, bottom, low, high, x, ofValue: y };
}

function drawLinedUp(add, width, { top, height }, recordings, lag) {
  const pitch = (width - LEFT - RIGHT) / SHOWN.samples;
  recordings.forEach((recording, number) => {
    const start = SHOWN.first + number * lag;
    const part = recording.subarray(start, start + SHOWN.samples);
    const loudest = Math.max(...part.map(Math.abs));
    const points = [...part].map((value, i) => [LEFT + i * pitch, top + height / 2 - ((value / loudest) * height) / 2]);
    add("path", { class: ["first", "second"][number], d: line(points) });
  });
}

function drawCurve(add, at, { curve, ribbon, lag, rivals, verdict }, words) {
  const reach = (curve.length - 1) / 2;
  const [low, high] = ribbon.map((value) => at.ofValue(clamp(value, at.low, at.high)));
  add("rect", { class: "ribbon", x: at.left, width: at.right - at.left, y: high, height: low - high });
  add("text", { x: at.right + 4, y: (low + high) / 2 + 4, class: "small faint" }, words.chance);
  add("path", { class: "zero", d: `M${at.left} ${at.ofValue(0)}H${at.right}` });
  const points = [];
  for (let each = at.first; each <= at.last; each++) points.push([at.x(each), at.ofValue(curve[each + reach])]);
  add("path", { class: "curve", "stroke-width": at.last - at.first > at.right ? 1 : 2, d: line(points) });
  const mark = (kind, each) => {
    if (each >= at.first && each <= at.last) {
      add("circle", { class: kind, cx: at.x(each), cy: at.ofValue(curve[each + reach]), r: kind === "rival" ? 5 : 7 });
    }
  };
  for (const rival of rivals) mark("rival", rival);
  mark(verdict === "nothing" ? "peak doubtful" : "peak", lag);
  const top = curve[lag + reach];
  const y = at.ofValue(top);
  if (Math.abs(y - (low + high) / 2) > 12) add("text", { x: at.right + 4, y: y + 4, class: "small" }, shortened(top, 2));
}

// Standard deviations on a logarithmic scale, with marks for the level of chance and the convincing level.
function drawAgreement(add, width, { top, height, bottom }, { evidence, chance, needed }, words) {
  const right = width - RIGHT;
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
