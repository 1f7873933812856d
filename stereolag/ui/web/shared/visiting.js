// Panels with examples to choose from. `VisitingPanel` also has places to visit one after the other, and Play, which
// visits them all; a panel adds its drawing, and its measurement of all places: their `values`, the value of a
// `perfect` match, and the places of the `peaks`, several if the highest value repeats. There are two measurements, each
// with its own lesson in every example: the "plain" one, and the `other` one, which the panel offers.

import { gapped } from "./dom.js";
import { svg } from "./lit_html.js";
import { clamp } from "./numbers.js";
import { Panel } from "./panel.js";

const PLACES_A_SECOND = 50;

export class ExamplesPanel extends Panel {
  begin({ examples }) {
    this.choose(examples[0]);
  }

  choose(example) {
    this.example = example;
    this.chosen = example.title;
  }
}

export class VisitingPanel extends ExamplesPanel {
  all;
  option = false; // whether the measurement is the other one
  other = ""; // name of the other one
  start = 0; // the place at which an example starts

  setUp() {
    this.atEnd(() => cancelAnimationFrame(this.playing));
  }

  choose(example) {
    super.choose(example);
    this.option = false;
    this.clear();
  }

  get measurement() {
    return this.option ? this.other : "plain";
  }

  turn(option) {
    this.option = option;
    this.measure();
    this.schedule();
  }

  clear() {
    this.pause();
    this.measure();
    this.place = this.start;
    this.visited = this.all.values.map((_, at) => at === this.start);
  }

  // Moves to a place and visits every place on the way; `jump` skips the places between.
  move(place, { jump = false } = {}) {
    const to = clamp(Math.round(place), 0, this.visited.length - 1);
    const [first, last] = jump ? [to, to] : [Math.min(this.place, to), Math.max(this.place, to)];
    this.visited.fill(true, first, last + 1);
    this.place = to;
    this.schedule();
  }

  go(place, how = {}) {
    this.pause();
    this.move(place, how);
  }

  // Actions of the keys that skip the places between, and of the key that plays.
  ends() {
    return {
      Home: () => this.go(0, { jump: true }),
      End: () => this.go(Infinity, { jump: true }),
      " ": () => this.toggle(),
    };
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  // Visits every place from the first to the last, then returns to the highest.
  play() {
    const last = this.visited.length - 1;
    this.place = 0;
    const still = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
    const begun = still ? -Infinity : performance.now();
    const go = (now) => {
      this.move(((now - begun) / 1000) * Math.min(PLACES_A_SECOND, this.visited.length / 3));
      if (this.place < last) this.playing = requestAnimationFrame(go);
      else {
        this.pause();
        this.move(this.all.peaks[0]);
      }
    };
    go(performance.now());
  }

  pause() {
    cancelAnimationFrame(this.playing);
    this.playing = undefined;
    this.schedule();
  }

  // The example's lesson, once every place has been visited.
  get said() {
    return this.visited.every(Boolean) && !this.playing ? this.example.said[this.measurement] : "";
  }

  measure() {}
}

// The known part of a panel's curve: the level of a perfect match and its label, the values at the visited places, the
// peaks once all have been visited, and the current place.
export function visitedCurve({ left, right, x, y, stroke }, { all, place, visited }, label, labelBelow) {
  const { values, perfect, peaks } = all;
  const kind = Math.max(...values) < perfect / 2 ? "peak doubtful" : "peak";
  return svg`
    <path class="perfect" d="M${left} ${y(perfect)}H${right}" />
    <text class="small faint" x=${right} y=${y(perfect) + labelBelow} text-anchor="end">${label}</text>
    <path class="curve" stroke-width=${stroke} d=${gapped(visited.map((seen, at) => seen && `${x(at)} ${y(values[at])}`))} />
    ${visited.every(Boolean) ? peaks.map((top) => svg`<circle class=${kind} cx=${x(top)} cy=${y(values[top])} r="7" />`) : ""}
    <circle class="now" cx=${x(place)} cy=${y(values[place])} r="5" />`;
}
