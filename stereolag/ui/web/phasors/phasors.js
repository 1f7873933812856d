// The arrows of a cross-spectrum, turned back by a lag, without server requests.

import { axis, plotted, runsOf } from "../shared/dom.js";
import { clamp, shortened } from "../shared/numbers.js";
import { visitedCurve, VisitingPanel } from "../shared/visiting.js";

const NONE = { width: 0, height: 0 };

export default class PhasorPanel extends VisitingPanel {
  other = "whitened";
  layout = { phases: NONE, magnitudes: NONE, chain: NONE, lags: NONE }; // the layout of each drawing

  get lag() {
    return lagAt(this.place, this.example);
  }

  get where() {
    const { data: { words }, example, lag } = this;
    const whole = (number) => shortened(number, Number.isInteger(number) ? 0 : 2);
    const there = example.excerpt ? ` (${whole(example.offset + lag * example.step)} ${words.there})` : "";
    const sum = shortened(this.all.values[this.place], 2);
    return `${words.lag} ${whole(lag)}${there} · ${words[this.measurement]} ${sum}`;
  }

  choose(example) {
    this.start = placeOf(0, example);
    super.choose(example);
  }

  measure() {
    this.all = this.example.measured[this.measurement];
  }

  goTo(lag, how = {}) {
    this.go(placeOf(lag, this.example), how);
  }

  grab(event, name) {
    event.preventDefault(); // do not select text
    this.find(".lag").focus({ preventScroll: true });
    const drawing = event.currentTarget;
    const lag = ({ clientX, clientY }) => {
      const { left, top } = drawing.getBoundingClientRect();
      return this.layout[name].lagOf(clientX - left, clientY - top);
    };
    this.goTo(lag(event), { jump: true });
    return { move: (moved) => this.goTo(lag(moved)) };
  }

  draw() {
    const drawings = { phases: phasesAt, magnitudes: magnitudesAt, chain: chainAt, lags: lagsAt };
    for (const [name, laidOut] of Object.entries(drawings)) {
      const width = this.find(`.${name}:is(svg)`).clientWidth;
      if (width) this.layout[name] = { width, ...laidOut(width, this) };
    }
    this.render();
  }
}

// The cross-spectrum as arrows, one complex number per frequency, and the chain they form head to tail.

const PLACES_A_SAMPLE = 4;

const lagAt = (place, example) => place / PLACES_A_SAMPLE - example.longest;
const placeOf = (lag, example) => Math.round((lag + example.longest) * PLACES_A_SAMPLE);

// The start of the chain and the tip of each arrow, as [x, y], y upwards: arrow k is turned back by k * lag / size,
// the share of a turn that frequency k makes in that time.
export function chained({ turns, size }, lengths, lag) {
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

// The four drawings: magnitudes and phase differences over frequency, the chain of arrows, and the curve over lags.

const SIDE = 34; // px to the left of a drawing with a scale
const EDGE = 12; // px beside a drawing without one, including half the thumb of the lag slider
const TURNS = 3;
const PHASES_HEIGHT = 220;
const REACH_HEIGHT = 46;
const CURVE_HEIGHT = 160;

const hueOf = (index, count) => `hsl(${Math.round(262 - (130 * index) / count)} 48% 58%)`;

// Maps a frequency, 0 to 0.5 turns per sample, to px.
const ofFrequency = (width) => (frequency) => SIDE + frequency * 2 * (width - SIDE - EDGE);

function magnitudesAt(width, { example: { magnitude_1, magnitude_2, size } }) {
  const paths = [magnitude_1, magnitude_2].map((all) => plotted(all, 1));
  return { right: width - EDGE, paths, count: size / 2, largest: Math.max(...magnitude_1, ...magnitude_2) };
}

// A dot for each frequency, repeated every whole turn up and down, and the ruler whose slope is the lag.
function phasesAt(width, { example, all: { lengths }, lag }) {
  const half = PHASES_HEIGHT / 2;
  const longest = Math.max(...lengths);
  const copies = [...Array(2 * TURNS + 2).keys()];
  const dots = example.turns.flatMap((turns, index) => {
    if (!(lengths[index] > 0)) return [];
    const frequency = (index + 1) / example.size;
    const nearest = turns + Math.round(frequency * lag - turns); // the copy from which the arrow is measured
    const r = 1.3 + 2.7 * Math.sqrt(lengths[index] / longest);
    const fill = hueOf(index, example.turns.length);
    const all = copies.map((copy) => turns - TURNS + copy).filter((copy) => Math.abs(copy) <= TURNS);
    return all.map((copy) => ({ frequency, turns: copy, r, fill, near: Math.abs(copy - nearest) < 0.01 }));
  });
  return {
    x: ofFrequency(width),
    y: (turns) => half - (turns / TURNS) * (half - 6),
    right: width - EDGE,
    dots,
    end: Math.min(0.5, lag ? TURNS / Math.abs(lag) : 0.5),
    lagOf: (px, py) => ((half - py) / (half - 6)) * (TURNS / Math.max((px - SIDE) / (2 * (width - SIDE - EDGE)), 0.04)),
  };
}

function chainAt(width, { all, lag, example }) {
  const height = clamp(0.56 * width, 260, 440);
  const [left, right, bottom, top] = all.bounds;
  const room = height - REACH_HEIGHT - 2 * EDGE;
  const scale = Math.min((width - 2 * EDGE) / (right - left), room / (top - bottom || 1));
  const x0 = (width - (right - left) * scale) / 2 - left * scale;
  const y0 = EDGE + (room - (top - bottom) * scale) / 2 + top * scale;
  const [x, y] = [(value) => x0 + value * scale, (value) => y0 - value * scale];
  const points = chained(example, all.lengths, lag);
  const arrows = points.slice(1).flatMap(([tipX, tipY], index) => {
    const [fromX, fromY] = points[index];
    const [dx, dy] = [(tipX - fromX) * scale, -(tipY - fromY) * scale];
    const length = Math.hypot(dx, dy);
    if (length < 0.2) return [];
    const head = clamp(length * 0.45, 0, 7) / length;
    const [tx, ty] = [x(tipX), y(tipY)];
    const barb = (side) => `${tx - head * (dx - side * 0.6 * dy)} ${ty - head * (dy + side * 0.6 * dx)}`;
    const d = `M${x(fromX)} ${y(fromY)}L${tx} ${ty}${length > 3 ? `M${barb(1)}L${tx} ${ty}L${barb(-1)}` : ""}`;
    return [{ d, stroke: hueOf(index, example.turns.length) }];
  });
  return { height, x, y, left, right, end: points.at(-1), bar: height - REACH_HEIGHT + 12, arrows };
}

function lagsAt(width, panel) {
  const { example, all, visited, data: { words } } = panel;
  const sides = { left: EDGE, right: width - EDGE };
  const pitch = (width - 2 * EDGE) / (visited.length - 1);
  const x = (at) => EDGE + at * pitch;
  const low = Math.min(0, ...all.values);
  const y = (value) => 22 + ((all.perfect - value) / (all.perfect - low)) * (CURVE_HEIGHT - 32);
  const point = (at) => `${x(at)} ${y(all.values[at])}`;
  const lags = { first: -example.longest, last: example.longest, x: (lag) => x(placeOf(lag, example)) };
  return {
    zero: y(0),
    right: sides.right,
    lags: axis({ ...sides, y: CURVE_HEIGHT, ...lags }),
    fill: runsOf(visited).map((run) => `M${x(run[0])} ${y(0)}L${run.map(point).join("L")}V${y(0)}Z`).join(""),
    curve: visitedCurve({ ...sides, x, y, stroke: 2.5 }, panel, words.in_line, -8),
    lagOf: (px) => lagAt((px - EDGE) / pitch, example),
  };
}
