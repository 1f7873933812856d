// A plan of both sensors and a draggable source, which shows the places that give the same lag.

import { button, line, say, shareOf, sized } from "../shared/dom.js";
import { branch, pathDifference, pathTo } from "../shared/hyperbola.js";
import { clamp } from "../shared/numbers.js";
import { arrows, onDrag, onKey, Panel, show } from "../shared/panel.js";

const WIDE = 4; // width of the plan, as a multiple of the distance between the sensors
const HIGH = 300;
const STEP = 0.01;

const PLACES = { "In line": [-1, 0], "Beside": [-0.6, 0.3], "As far from both": [0, 0.6] }; // in distances of the sensors

const significant = (value, digits) => value.toLocaleString("en", { maximumSignificantDigits: digits });
const metres = (value) => `${significant(value, 4)}\u00a0m`;

// Places of a sensor's name beside it, px to the right and down, and half the width, the height above its line and the
// depth below it that it takes there.
const NAMED_AT = [[0, 22], [0, -14], [-42, 22], [42, 22], [-42, -14], [42, -14]];
const NAME = { half: 26, above: 13, below: 5 };

export default (component) => show(Plan, component);

// The first of these places where no line crosses the name, or the first of all; lines are lists of points, px.
export function freePlace([x, y], lines) {
  /** @param {number[]} place */
  const isFree = ([right, down]) => {
    const [left, top] = [x + right - NAME.half, y + down - NAME.above];
    const box = [left, left + 2 * NAME.half, top, top + NAME.above + NAME.below];
    return !lines.some((points) => points.slice(1).some((point, index) => crosses(box, points[index], point)));
  };
  return NAMED_AT.find(isFree) ?? NAMED_AT[0];
}

// Whether a segment has a part within a box.
/** @type {(box: number[], start: number[], end: number[]) => boolean} */
const crosses = ([left, right, top, bottom], [x0, y0], [x1, y1]) => {
  // Where it is between two sides, as shares of its length.
  const between = (from, to, low, high) => {
    if (from === to) return low <= from && from <= high ? [0, 1] : [1, 0];
    const shares = [(low - from) / (to - from), (high - from) / (to - from)];
    return [Math.min(...shares), Math.max(...shares)];
  };
  const [across, down] = [between(x0, x1, left, right), between(y0, y1, top, bottom)];
  return Math.max(0, across[0], down[0]) <= Math.min(1, across[1], down[1]);
};

class Plan extends Panel {
  constructor(parent) {
    super(parent, "plan");
    this.svg = this.find("svg");
    this.range = this.find("input");
    this.range.addEventListener("input", () => this.spread(Number(this.range.value)));
    onKey(this.stage, (event) => arrows(event, (down, right) => {
      const step = this.apart * STEP;
      this.move([this.source[0] + right * step, this.source[1] - down * step]);
    }));
    onDrag(this.stage, (event) => {
      this.move(this.placeOf(event));
      return { move: (moved) => this.move(this.placeOf(moved)) };
    });
    this.watchSize(this.stage);
  }

  begin({ colours, difference, example }) {
    this.colour(colours);
    this.sign = difference < 0 ? -1 : 1;
    this.smallest = Math.abs(difference) || example;
    this.apart = this.smallest * Number(this.range.value);
    /** @param {number[]} place */
    const go = ([x, y]) => this.move([this.sign * x * this.apart, y * this.apart]);
    this.find(".places").replaceChildren(...Object.entries(PLACES).map(([name, place]) => button(name, () => go(place))));
    go(PLACES.Beside);
  }

  // Moves the sensors further apart or closer together; the source keeps its place on the plan.
  spread(times) {
    const before = this.apart;
    this.apart = this.smallest * times;
    this.move(this.source.map((each) => (each * this.apart) / before));
  }

  /** @param {number[]} source */
  move([x, y]) {
    const half = (WIDE / 2) * this.apart;
    const high = this.svg.clientWidth ? (half * HIGH) / this.svg.clientWidth : half;
    this.source = [clamp(x, -half, half), clamp(y, -high, high)];
    this.draw();
  }

  placeOf(event) {
    const [right, down] = shareOf(event, this.svg);
    const wide = WIDE * this.apart;
    return [(right - 0.5) * wide, ((0.5 - down) * wide * HIGH) / this.svg.clientWidth];
  }

  draw() {
    const width = this.svg.clientWidth;
    if (!width || !this.source) return;
    const { apart, source } = this;
    const scale = width / (WIDE * apart);
    /** @param {number[]} place */
    const at = ([x, y]) => [width / 2 + x * scale, HIGH / 2 - y * scale];
    const path = (points) => line(points.map(at));
    const difference = pathDifference(source, apart);
    const sensors = [[-apart / 2, 0], [apart / 2, 0]];
    const reach = WIDE * apart;
    const add = sized(this.svg, width, HIGH);
    add("path", { class: "line", d: `M0 ${HIGH / 2}H${width}` });
    const drawn = [
      ...(this.data.difference === null ? [] : [{ name: "measured", points: branch(this.data.difference, apart, reach) }]),
      { name: "same", points: branch(difference, apart, reach) },
      ...sensors.map((sensor) => ({ name: "path", points: [source, sensor] })),
    ];
    for (const { name, points } of drawn) add("path", { class: name, d: path(points) });
    const farther = sensors[difference > 0 ? 1 : 0];
    const length = pathTo(source, farther[0]);
    const share = length ? Math.abs(difference) / length : 0;
    const turn = farther.map((each, axis) => each + (source[axis] - each) * share);
    add("path", { class: "longer", d: path([turn, farther]) });
    const lines = drawn.map(({ points }) => points.map(at));
    sensors.forEach((sensor, index) => {
      const [x, y] = at(sensor);
      add("circle", { class: `sensor-${index + 1}`, cx: x, cy: y, r: 7 });
      const [right, below] = freePlace([x, y], lines);
      add("text", { x: x + right, y: y + below }, `sensor ${index + 1}`);
    });
    const [x, y] = at(source);
    add("circle", { class: "source", cx: x, cy: y, r: 9 });
    add("text", { x: clamp(x, 22, width - 22), y: y < 24 ? y + 24 : y - 14 }, "source");
    this.find("output").textContent = metres(apart);
    this.tell(difference);
  }

  tell(difference) {
    const { apart, data } = this;
    const size = Math.abs(difference);
    const [later, earlier] = difference > 0 ? [2, 1] : [1, 2];
    const seconds = `${significant(size / data.speed, 3)}\u00a0s`;
    const longer = `The path to sensor ${later} is ${metres(size)} longer: it hears the source ${seconds} after sensor ${earlier}.`;
    const words = size < 0.005 * apart
      ? "Both paths are equally long: the lag is 0, however far apart the sensors are."
      : `${longer} ${size > 0.995 * apart
        ? "In line with the sensors, the path difference is their distance."
        : `The sensors are ${metres(apart)} apart, more than the path difference.`}`;
    const same = data.difference !== null && Math.abs(difference - data.difference) < 0.02 * apart;
    say(this.find(".said"), same ? `${words} This is your lag.` : words);
  }
}
