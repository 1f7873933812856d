// A plan of both sensors and a draggable source, which shows the places that give the same lag.

import { line, shareOf } from "../shared/dom.js";
import { branch, pathDifference, pathTo } from "../shared/hyperbola.js";
import { clamp } from "../shared/numbers.js";
import { arrows, Panel, show } from "../shared/panel.js";

const WIDE = 4; // width of the plan, as a multiple of the distance between the sensors
const HIGH = 300;
const STEP = 0.01;

const PLACES = { "In line": [-1, 0], "Beside": [-0.6, 0.3], "As far from both": [0, 0.6] }; // in distances of the sensors

const significant = (value, digits) => value.toLocaleString("en", { maximumSignificantDigits: digits });

// Places of a sensor's name beside it, px to the right and down, and half the width, the height above its line and the
// depth below it that it takes there.
const NAMED_AT = [[0, 22], [0, -14], [-42, 22], [42, 22], [-42, -14], [42, -14]];
const NAME = { half: 26, above: 13, below: 5 };

export default (component) => show(Plan, component, view);

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

// Whether a segment has a part within a box: it reaches into its width and height, and has corners on both sides.
/** @type {(box: number[], start: number[], end: number[]) => boolean} */
const crosses = ([left, right, top, bottom], [x0, y0], [x1, y1]) => {
  const corners = [[left, top], [right, top], [left, bottom], [right, bottom]];
  const sides = corners.map(([x, y]) => Math.sign((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)));
  const across = Math.min(x0, x1) <= right && Math.max(x0, x1) >= left;
  const down = Math.min(y0, y1) <= bottom && Math.max(y0, y1) >= top;
  return across && down && new Set(sides).size > 1;
};

class Plan extends Panel {
  times = 1.5; // how many times the path difference the sensors are apart, at least

  begin({ difference, example }) {
    this.sign = difference < 0 ? -1 : 1;
    this.smallest = Math.abs(difference) || example;
    this.go("Beside");
  }

  get apart() {
    return this.smallest * this.times;
  }

  metres(value) {
    return `${significant(value, 4)}\u00a0m`;
  }

  go(name) {
    const [x, y] = PLACES[name];
    this.move([this.sign * x * this.apart, y * this.apart]);
  }

  // Moves the sensors further apart or closer together; the source keeps its place on the plan.
  spread(times) {
    const source = this.source.map((each) => (each * times) / this.times);
    this.times = times;
    this.move(source);
  }

  /** @param {number[]} source */
  move([x, y]) {
    const half = (WIDE / 2) * this.apart;
    const high = this.layout.width ? (half * HIGH) / this.layout.width : half;
    this.source = [clamp(x, -half, half), clamp(y, -high, high)];
    this.schedule();
  }

  grab(event) {
    const move = (moved) => {
      const [right, down] = shareOf(moved, this.find("svg"));
      const wide = WIDE * this.apart;
      this.move([(right - 0.5) * wide, ((0.5 - down) * wide * HIGH) / this.layout.width]);
    };
    move(event);
    return { move };
  }

  actions(event) {
    const step = this.apart * STEP;
    return arrows(event, (down, right) => this.move([this.source[0] + right * step, this.source[1] - down * step]));
  }

  layOut(width) {
    const { apart, source, data } = this;
    const scale = width / (WIDE * apart);
    /** @param {number[]} place */
    const at = ([x, y]) => [width / 2 + x * scale, HIGH / 2 - y * scale];
    const difference = pathDifference(source, apart);
    const sensors = [[-apart / 2, 0], [apart / 2, 0]];
    const lines = [
      ...(data.difference === null ? [] : [{ name: "measured", points: branch(data.difference, apart, WIDE * apart) }]),
      { name: "same", points: branch(difference, apart, WIDE * apart) },
      ...sensors.map((sensor) => ({ name: "path", points: [source, sensor] })),
    ].map(({ name, points }) => ({ name, points: points.map(at) }));
    const farther = sensors[difference > 0 ? 1 : 0];
    const length = pathTo(source, farther[0]);
    const share = length ? Math.abs(difference) / length : 0;
    const turn = farther.map((each, axis) => each + (source[axis] - each) * share);
    return {
      lines: lines.map(({ name, points }) => ({ name, d: line(points) })),
      longer: line([turn, farther].map(at)),
      sensors: sensors.map(at).map(([x, y]) => [x, y, ...freePlace([x, y], lines.map(({ points }) => points))]),
      source: at(source),
    };
  }

  said() {
    const { apart, data, metres } = this;
    const difference = pathDifference(this.source, apart);
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
    return same ? `${words} This is your lag.` : words;
  }
}

