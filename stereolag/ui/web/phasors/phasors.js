// The arrows of a cross-spectrum, turned back by a lag, without server requests.

import { drawAxis, element, line, runsOf, sized } from "../shared/dom.js";
import { clamp, shortened, total } from "../shared/numbers.js";
import { onDrag, onKey, show } from "../shared/panel.js";
import { drawVisited, VisitingPanel } from "../shared/visiting.js";

export default (component) => show(PhasorPanel, component);

class PhasorPanel extends VisitingPanel {
  constructor(parent) {
    super(parent);
    this.slider = this.find(".lag");
    this.slider.addEventListener("input", () => this.go(this.slider.valueAsNumber));
    this.find(".whiten").addEventListener("change", () => this.measure());
    // Home and End skip the lags between, as a click elsewhere does; the slider itself handles the other keys.
    onKey(this.slider, () => ({
      Home: () => this.go(-this.example.longest, { jump: true }),
      End: () => this.go(this.example.longest, { jump: true }),
      " ": () => this.toggle(),
    }));
    for (const name of ["phases", "lags"]) onDrag(this.find(`.${name}`), (event) => this.grab(event, name));
  }

  prepare() {
    const { longest } = this.example;
    this.start = placeOf(0, this.example);
    Object.assign(this.slider, { min: -longest, max: longest, step: 1 / PLACES_A_SAMPLE });
    this.find(".whiten").checked = false;
    for (const [name, [title, text]] of Object.entries(this.data.words.captions)) {
      this.find(`.caption-${name}`).replaceChildren(element("strong", "", title), `: ${text}`);
    }
  }

  measure() {
    this.whitened = this.find(".whiten").checked;
    this.all = measuredChains(this.example, this.whitened);
    this.schedule();
  }

  go(lag, how = {}) {
    this.pause();
    this.move(placeOf(lag, this.example), how);
  }

  grab(event, name) {
    if (!this.lagOf) return null;
    event.preventDefault(); // do not select text
    this.slider.focus({ preventScroll: true });
    const drawing = event.currentTarget;
    const lag = ({ clientX, clientY }) => {
      const { left, top } = drawing.getBoundingClientRect();
      return this.lagOf[name](clientX - left, clientY - top);
    };
    this.go(lag(event), { jump: true });
    return { move: (moved) => this.go(lag(moved)) };
  }

  draw() {
    if (!this.all || !this.find(".lags").clientWidth) return;
    const { words } = this.data;
    const { example, all, place, whitened } = this;
    const lag = lagAt(place, example);
    drawMagnitudes(this.find(".magnitudes"), example, { whiten: whitened, words });
    drawChain(this.find(".chain"), all, { place, words, count: example.turns.length });
    this.lagOf = {
      phases: drawPhases(this.find(".phases"), example, all, { lag, words }),
      lags: drawReaches(this.find(".lags"), this, words.in_line),
    };
    const whole = (number) => shortened(number, Number.isInteger(number) ? 0 : 2);
    const there = example.excerpt ? ` (${whole(example.offset + lag * example.step)} ${words.there})` : "";
    const said = `${words.lag} ${whole(lag)}${there} · ${words[whitened ? "whitened" : "plain"]} ${shortened(all.values[place], 2)}`;
    this.slider.value = lag;
    this.slider.setAttribute("aria-valuetext", said);
    this.tell(said, example.said[whitened ? "whitened" : "plain"]);
  }
}

// The cross-spectrum as arrows, one complex number per frequency, and the chain they form head to tail.

const PLACES_A_SAMPLE = 4;

export const lagAt = (place, example) => place / PLACES_A_SAMPLE - example.longest;
const placeOf = (lag, example) => Math.round((lag + example.longest) * PLACES_A_SAMPLE);

// The lengths of the arrows: the product of both magnitudes. Whitened (PHAT), they are equal and add up to 1; empty
// frequencies are left out.
function arrowLengths({ magnitude_1, magnitude_2 }, whiten) {
  const products = magnitude_1.map((magnitude, index) => magnitude * magnitude_2[index]);
  if (!whiten) return products;
  const heard = products.filter((product) => product > 0).length;
  return products.map((product) => (product > 0 ? 1 / heard : 0));
}

// The start of the chain and the tip of each arrow, as [x, y], y upwards: arrow k is turned back by k * lag / size,
// the share of a turn that frequency k makes in that time.
function chainAt({ turns, size }, lengths, lag) {
  let [x, y] = [0, 0];
  const points = [[x, y]];
  lengths.forEach((length, index) => {
    const angle = 2 * Math.PI * (((index + 1) * lag) / size - turns[index]);
    x += length * Math.cos(angle);
    y += length * Math.sin(angle);
    points.push([x, y]);
  });
  return points;
}

// Everything drawn for one example: the chain at each place, how far to the right it ends (the value, a correlation), how far
// it would reach with all arrows in line (a perfect match), and the peaks, the smallest lag first.
export function measuredChains(example, whiten) {
  const lengths = arrowLengths(example, whiten);
  const places = placeOf(example.longest, example) + 1;
  const chains = Array.from({ length: places }, (_, place) => chainAt(example, lengths, lagAt(place, example)));
  const values = chains.map((points) => points.at(-1)[0]);
  const [xs, ys] = [0, 1].map((axis) => chains.flat().map((point) => point[axis]));
  const perfect = total(lengths);
  const bounds = { left: Math.min(...xs), right: Math.max(perfect, ...xs), bottom: Math.min(...ys), top: Math.max(...ys) };
  const top = Math.max(...values);
  const isPeak = (value, place) => top - value < 1e-3 && !(value < values[place - 1]) && !(value < values[place + 1]);
  const size = (place) => Math.abs(lagAt(place, example));
  const peaks = [...values.keys()].filter((place) => isPeak(values[place], place)).sort((one, other) => size(one) - size(other));
  return { lengths, chains, values, perfect, peaks, bounds };
}

// The four drawings: magnitudes and phase differences over frequency, the chain of arrows, and the curve over lags.

const SIDE = 34; // px to the left of a drawing with a scale
const EDGE = 12; // px beside a drawing without one, including half the thumb of the lag slider
const TURNS = 3;
const MAGNITUDES_HEIGHT = 100;
const NAMES_HEIGHT = 18;
const PHASES_HEIGHT = 220;
const PHASES_AXIS = 34;
const REACH_HEIGHT = 46;
const CURVE_HEIGHT = 160;
const CURVE_AXIS = 20;

const hueOf = (index, count) => `hsl(${Math.round(262 - (130 * index) / count)} 48% 58%)`;

// Maps a frequency, 0 to 0.5 turns per sample, to px.
const ofFrequency = (width) => (frequency) => SIDE + frequency * 2 * (width - SIDE - EDGE);

function drawMagnitudes(svg, example, { whiten, words }) {
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
function drawPhases(svg, example, all, { lag, words }) {
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

function drawChain(svg, all, { place, words, count }) {
  const width = svg.clientWidth;
  const height = clamp(0.56 * width, 260, 440);
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

  add("path", { class: "zero", d: `M${x(left)} ${bar}H${x(right)}M${x(0)} ${bar - 5}v10M${x(all.perfect)} ${bar - 5}v10` });
  add("path", { class: "reach", d: `M${x(0)} ${bar}H${x(endX)}` });
  add("text", { x: x(0), y: bar + 20, class: "small faint", "text-anchor": "middle" }, "0");
  add("text", { x: x(all.perfect), y: bar + 20, class: "small faint", "text-anchor": "end" }, `${words.in_line}: ${shortened(all.perfect, 2)}`);
}

function drawReaches(svg, panel, label) {
  const { example, all, visited } = panel;
  const add = sized(svg, svg.clientWidth, CURVE_HEIGHT + CURVE_AXIS);
  const width = svg.clientWidth;
  const pitch = (width - 2 * EDGE) / (visited.length - 1);
  const x = (at) => EDGE + at * pitch;
  const low = Math.min(0, ...all.values);
  const y = (value) => 22 + ((all.perfect - value) / (all.perfect - low)) * (CURVE_HEIGHT - 32);
  add("path", { class: "zero", d: `M${EDGE} ${y(0)}H${width - EDGE}` });
  const lags = { first: -example.longest, last: example.longest, x: (lag) => x(placeOf(lag, example)) };
  drawAxis(add, { left: EDGE, right: width - EDGE, y: CURVE_HEIGHT, ...lags });
  const point = (at) => `${x(at)} ${y(all.values[at])}`;
  const fills = runsOf(visited).map((run) => `M${x(run[0])} ${y(0)}L${run.map(point).join("L")}V${y(0)}Z`);
  add("path", { class: "fill", d: fills.join("") });
  drawVisited(add, { left: EDGE, right: width - EDGE, x, y, stroke: 2.5 }, panel, label, -8);
  return (px) => lagAt((px - EDGE) / pitch, example);
}
