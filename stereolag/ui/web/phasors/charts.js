// The four drawings: magnitudes and phase differences over frequency, the chain of arrows, and the curve over lags.

import { line, sized } from "../shared/dom.js";
import { clamp, shortened, ticks } from "../shared/numbers.js";
import { pathOf, runsOf } from "../shared/visiting.js";
import { highestReaches, lagAt, placeOf } from "./chain.js";

const SIDE = 34; // px to the left of a drawing with a scale
const EDGE = 12; // px beside a drawing without one, including half the thumb of the lag slider
const TURNS = 3;
const MAGNITUDES_HEIGHT = 100;
const NAMES_HEIGHT = 18;
const PHASES_HEIGHT = 230;
const PHASES_AXIS = 34;
const REACH_HEIGHT = 46;
const CURVE_HEIGHT = 160;
const CURVE_AXIS = 20;
const TICK_PX = 44;

const hueOf = (index, count) => `hsl(${Math.round(262 - (130 * index) / count)} 48% 58%)`;

// Maps a frequency, 0 to 0.5 turns per sample, to px.
const ofFrequency = (width) => (frequency) => SIDE + frequency * 2 * (width - SIDE - EDGE);

export function drawMagnitudes(svg, example, { whiten, words }) {
  const add = sized(svg, svg.clientWidth, MAGNITUDES_HEIGHT);
  const width = svg.clientWidth;
  const x = ofFrequency(width);
  const bottom = MAGNITUDES_HEIGHT - 4;
  const largest = Math.max(...example.magnitude_1, ...example.magnitude_2);
  const y = (value) => bottom - (value / largest) * (bottom - NAMES_HEIGHT - 4);
  const curve = (values) => line(values.map((value, index) => [x((index + 1) / example.size), y(value)]));
  add("path", { class: "zero", d: `M${SIDE} ${bottom}H${width - EDGE}` });
  add("path", { class: whiten ? "first aside" : "first", d: curve(example.magnitude_1) });
  add("path", { class: whiten ? "second aside" : "second", d: curve(example.magnitude_2) });
  if (whiten) add("path", { class: "equal", d: `M${x(1 / example.size)} ${NAMES_HEIGHT + 4}H${x(example.turns.length / example.size)}` });
  words.recordings.forEach((name, index) =>
    add("text", { x: width - EDGE - 80 * (1 - index), y: 12, class: `small of-${index + 1}`, "text-anchor": "end" }, name),
  );
}

// A dot for each frequency, repeated every whole turn up and down, and the ruler whose slope is the lag.
export function drawPhases(svg, example, all, { lag, words }) {
  const height = PHASES_HEIGHT + PHASES_AXIS;
  const add = sized(svg, svg.clientWidth, height);
  const width = svg.clientWidth;
  const x = ofFrequency(width);
  const y = (turns) => PHASES_HEIGHT / 2 - (turns / TURNS) * (PHASES_HEIGHT / 2 - 6);
  for (let turn = -TURNS; turn <= TURNS; turn++) {
    add("path", { class: turn ? "zero thin" : "zero", d: `M${SIDE} ${y(turn)}H${width - EDGE}` });
    add("text", { x: SIDE - 6, y: y(turn) + 4, class: "small faint", "text-anchor": "end" }, shortened(turn, 0));
  }
  for (const frequency of [0, 0.1, 0.2, 0.3, 0.4, 0.5]) {
    add("text", { x: x(frequency), y: PHASES_HEIGHT + 14, class: "small faint", "text-anchor": "middle" }, frequency ? `${frequency}` : "0");
  }
  add("text", { x: (SIDE + width - EDGE) / 2, y: height - 4, class: "small faint", "text-anchor": "middle" }, words.frequency);
  const longest = Math.max(...all.lengths);
  const count = example.turns.length;
  example.turns.forEach((turns, index) => {
    if (!(all.lengths[index] > 0)) return;
    const frequency = (index + 1) / example.size;
    const nearest = turns + Math.round(frequency * lag - turns); // the copy from which the arrow is measured
    const r = 1.3 + 2.7 * Math.sqrt(all.lengths[index] / longest);
    for (let copy = turns - TURNS; copy <= TURNS; copy++) {
      if (copy < -TURNS) continue;
      const near = Math.abs(copy - nearest) < 0.01;
      add("circle", { class: near ? "dot near" : "dot", cx: x(frequency), cy: y(copy), r, fill: hueOf(index, count) });
    }
  });
  const end = Math.min(0.5, lag ? TURNS / Math.abs(lag) : 0.5);
  add("path", { class: "ruler", d: `M${x(0)} ${y(0)}L${x(end)} ${y(end * lag)}` });
  add("circle", { class: "handle", cx: x(end), cy: y(end * lag), r: 6 });
  return (px, py) => {
    const frequency = Math.max((px - SIDE) / (2 * (width - SIDE - EDGE)), 0.04);
    return ((PHASES_HEIGHT / 2 - py) / (PHASES_HEIGHT / 2 - 6)) * (TURNS / frequency);
  };
}

export function drawChain(svg, all, { place, words, count }) {
  const width = svg.clientWidth;
  const height = clamp(0.78 * width, 340, 440);
  const add = sized(svg, svg.clientWidth, height);
  const { left, right, bottom, top } = all.bounds;
  const room = height - REACH_HEIGHT - 2 * EDGE;
  const scale = Math.min((width - 2 * EDGE) / (right - left), room / (top - bottom || 1));
  const x0 = (width - (right - left) * scale) / 2 - left * scale;
  const y0 = EDGE + (room - (top - bottom) * scale) / 2 + top * scale;
  const [x, y] = [(value) => x0 + value * scale, (value) => y0 - value * scale];
  const points = all.chains[place];
  const [endX, endY] = points.at(-1);
  const bar = height - REACH_HEIGHT + 12;

  add("path", { class: "zero", d: `M${x(left)} ${y(0)}H${x(right)}` });
  add("path", { class: "guide", d: `M${x(0)} ${y(0)}V${bar}M${x(endX)} ${y(endY)}V${bar}` });
  points.slice(1).forEach(([tipX, tipY], index) => {
    const [fromX, fromY] = points[index];
    const [dx, dy] = [(tipX - fromX) * scale, -(tipY - fromY) * scale];
    const length = Math.hypot(dx, dy);
    if (length < 0.2) return;
    const head = clamp(length * 0.45, 0, 7) / length;
    const [tx, ty] = [x(tipX), y(tipY)];
    const barb = (side) => `${tx - head * (dx - side * 0.6 * dy)} ${ty - head * (dy + side * 0.6 * dx)}`;
    const d = `M${x(fromX)} ${y(fromY)}L${tx} ${ty}${length > 3 ? `M${barb(1)}L${tx} ${ty}L${barb(-1)}` : ""}`;
    add("path", { class: "arrow", d, stroke: hueOf(index, count) });
  });
  add("circle", { class: "from", cx: x(0), cy: y(0), r: 4 });
  add("circle", { class: "now", cx: x(endX), cy: y(endY), r: 5 });

  add("path", { class: "zero", d: `M${x(left)} ${bar}H${x(right)}M${x(0)} ${bar - 5}v10M${x(all.total)} ${bar - 5}v10` });
  add("path", { class: "reach", d: `M${x(0)} ${bar}H${x(endX)}` });
  add("text", { x: x(0), y: bar + 20, class: "small faint", "text-anchor": "middle" }, "0");
  add("text", { x: x(all.total), y: bar + 20, class: "small faint", "text-anchor": "end" }, `${words.in_line}: ${shortened(all.total, 2)}`);
}

export function drawReaches(svg, example, all, { place, visited, words }) {
  const add = sized(svg, svg.clientWidth, CURVE_HEIGHT + CURVE_AXIS);
  const width = svg.clientWidth;
  const pitch = (width - 2 * EDGE) / (visited.length - 1);
  const x = (at) => EDGE + at * pitch;
  const low = Math.min(0, ...all.reaches);
  const y = (value) => 22 + ((all.total - value) / (all.total - low)) * (CURVE_HEIGHT - 32);
  add("path", { class: "zero", d: `M${EDGE} ${y(0)}H${width - EDGE}` });
  add("path", { class: "perfect", d: `M${EDGE} ${y(all.total)}H${width - EDGE}` });
  add("text", { x: width - EDGE, y: y(all.total) - 8, class: "small faint", "text-anchor": "end" }, words.in_line);
  const least = (TICK_PX * 2 * example.longest) / (width - 2 * EDGE);
  for (const lag of ticks(-example.longest, example.longest, least)) {
    const at = x(placeOf(lag, example));
    add("path", { class: "zero", d: `M${at} ${CURVE_HEIGHT}v4` });
    add("text", { x: at, y: CURVE_HEIGHT + 17, class: "small faint", "text-anchor": "middle" }, shortened(lag));
  }
  const point = (at) => `${x(at)} ${y(all.reaches[at])}`;
  const runs = runsOf(visited);
  const fills = runs.map((run) => `M${x(run[0])} ${y(0)}L${run.map(point).join("L")}V${y(0)}Z`);
  add("path", { class: "fill", d: fills.join("") });
  add("path", { class: "curve", "stroke-width": 2.5, d: pathOf(runs, point) });
  if (visited.every(Boolean)) {
    const kind = Math.max(...all.reaches) < all.total / 2 ? "peak doubtful" : "peak";
    for (const top of highestReaches(all, example)) add("circle", { class: kind, cx: x(top), cy: y(all.reaches[top]), r: 7 });
  }
  add("circle", { class: "now", cx: x(place), cy: y(all.reaches[place]), r: 5 });
  return (px) => lagAt((px - EDGE) / pitch, example);
}
