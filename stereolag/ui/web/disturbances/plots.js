// Four strips: both recordings lined up, the curve with its chance band, its peak up close, and the agreement.

import { drawAxis, line, sized, stacked } from "../shared/dom.js";
import { clamp, shortened } from "../shared/numbers.js";

const LEFT = 6;
const RIGHT = 40;
const NAME = 20; // px for the name above each strip
const HEIGHTS = { recordings: 56, curve: 150, close: 100, agreement: 14 };
const BELOW = { recordings: 10, curve: 40, close: 26, agreement: 22 };
const SHOWN = { first: 3000, samples: 240, about: 60 };
const MOST_AGREEMENT = 100;

export function drawDisturbed(svg, { recordings, judgement, lag: trueLag, words }) {
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
