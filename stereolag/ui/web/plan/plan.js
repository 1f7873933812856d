// A plan of both sensors and a draggable source, with the curve of all sources that give the same lag.

import { shareOf } from "../shared/dom.js";
import { branch, pathDifference, pathTo, SENSORS } from "../shared/hyperbola.js";
import { clamp } from "../shared/numbers.js";
import { arrows, Panel } from "../shared/panel.js";

// Lengths on the plan are in units of the sensor spacing.
const WIDE = 4;
const STEP = 0.01;
const PLACES = { "In line": [-1, 0], "Beside": [-0.6, 0.3], "Equidistant": [0, 0.6] };

const HIGH = 300; // px

const significant = (value, digits) => value.toLocaleString("en", { maximumSignificantDigits: digits });

export default class Plan extends Panel {
  times = 1.5; // sensor spacing over the smallest possible one, the path difference

  begin({ difference, example }) {
    this.sign = difference < 0 ? -1 : 1;
    this.smallest = Math.abs(difference) || example;
    this.go("Beside");
  }

  // The sensor spacing, metres.
  get apart() {
    return this.smallest * this.times;
  }

  metres(value) {
    return `${significant(value, 4)}\u00a0m`;
  }

  go(name) {
    const [x, y] = PLACES[name];
    this.move([this.sign * x, y]);
  }

  move([x, y]) {
    const half = WIDE / 2;
    const high = this.layout.width ? (half * HIGH) / this.layout.width : half;
    this.source = [clamp(x, -half, half), clamp(y, -high, high)];
    this.schedule();
  }

  grab(event) {
    const move = (moved) => {
      const [right, down] = shareOf(moved, this.find("svg"));
      this.move([(right - 0.5) * WIDE, ((0.5 - down) * WIDE * HIGH) / this.layout.width]);
    };
    move(event);
    return { move };
  }

  actions(event) {
    return arrows(event, (down, right) => this.move([this.source[0] + right * STEP, this.source[1] - down * STEP]));
  }

  layOut(width) {
    const { apart, source, data } = this;
    /** @type {(place: number[]) => number[]} */
    const at = ([x, y]) => [width / 2 + (x * width) / WIDE, HIGH / 2 - (y * width) / WIDE];
    const difference = pathDifference(source);
    const farther = SENSORS[difference > 0 ? 1 : 0];
    const share = Math.abs(difference) / (pathTo(source, farther) || 1);
    const turn = farther.map((each, axis) => each + (source[axis] - each) * share);
    const drawn = (name, points) => ({ name, d: `M${points.map(at).join("L")}` });
    return {
      lines: [
        ...(data.difference === null ? [] : [drawn("measured", branch(data.difference / apart))]),
        drawn("same", branch(difference)),
        ...SENSORS.map((sensor) => drawn("path", [source, sensor])),
        drawn("longer", [turn, farther]),
      ],
      sensors: SENSORS.map(at),
      source: at(source),
    };
  }

  said() {
    const { apart, data, metres } = this;
    const difference = pathDifference(this.source);
    const size = Math.abs(difference);
    const [later, earlier] = difference > 0 ? [2, 1] : [1, 2];
    const seconds = `${significant((size * apart) / data.speed, 3)}\u00a0s`;
    const longer = `The path to sensor ${later} is ${metres(size * apart)} longer: it hears the source ${seconds} after sensor ${earlier}.`;
    const words = size < 0.005
      ? "Both paths are equally long: the lag is 0, however far apart the sensors are."
      : `${longer} ${size > 0.995
        ? "In line with the sensors, the path difference equals their distance."
        : `The sensors are ${metres(apart)} apart, more than the path difference.`}`;
    const same = data.difference !== null && Math.abs(difference - data.difference / apart) < 0.02;
    return same ? `${words} This is your lag.` : words;
  }
}
