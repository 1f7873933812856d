// Panels with examples to choose from. `VisitingPanel` also has places to visit one after the other, and Play, which visits
// them all; a panel adds its drawing, and its measurement of all places: their `values`, the value of a `perfect` match, and
// the places of the `peaks`, several if the highest value repeats.

import { button, gapped, say, showPressed } from "./dom.js";
import { clamp } from "./numbers.js";
import { Panel } from "./panel.js";

const PLACES_A_SECOND = 50;

export class ExamplesPanel extends Panel {
  begin({ colours, examples }) {
    this.colour(colours);
    this.find(".examples").replaceChildren(...examples.map((example) => button(example.title, () => this.choose(example))));
    this.choose(examples[0]);
  }

  choose(example) {
    this.example = example;
    this.showExample(example.title);
    this.find(".try").textContent = example.try;
  }

  showExample(title) {
    showPressed(this.find(".examples").children, (one) => one.textContent === title);
  }
}

export class VisitingPanel extends ExamplesPanel {
  start = 0; // the place at which an example starts
  /** @type {any} */
  all;

  constructor(parent) {
    super(parent, "panel");
    this.find(".play").addEventListener("click", () => this.toggle());
    this.find(".clear").addEventListener("click", () => this.clear());
    this.watchSize(this.root);
  }

  close() {
    super.close();
    this.pause();
  }

  choose(example) {
    super.choose(example);
    this.prepare();
    this.clear();
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
    this.showState();
  }

  pause() {
    cancelAnimationFrame(this.playing);
    this.playing = undefined;
    this.showState();
  }

  showState() {
    this.find(".play").textContent = this.playing ? "❚❚ Pause" : "▶ Play";
  }

  // Shows the current place and, once every place has been visited, the example's lesson.
  tell(where, lesson) {
    this.find(".where").textContent = where;
    say(this.find(".said"), this.visited.every(Boolean) && !this.playing ? lesson : "");
  }

  prepare() {}

  measure() {}
}

// Draws what is known of a panel's curve: the level of a perfect match and its label, the values at the places visited, the
// peaks once all have been, and the current place.
export function drawVisited(add, { left, right, x, y, stroke }, { all, place, visited }, label, labelBelow) {
  const { values, perfect, peaks } = all;
  add("path", { class: "perfect", d: `M${left} ${y(perfect)}H${right}` });
  add("text", { x: right, y: y(perfect) + labelBelow, class: "small faint", "text-anchor": "end" }, label);
  const d = gapped(visited.map((seen, at) => seen && `${x(at)} ${y(values[at])}`));
  add("path", { class: "curve", "stroke-width": stroke, d });
  if (visited.every(Boolean)) {
    const kind = Math.max(...values) < perfect / 2 ? "peak doubtful" : "peak";
    for (const top of peaks) add("circle", { class: kind, cx: x(top), cy: y(values[top]), r: 7 });
  }
  add("circle", { class: "now", cx: x(place), cy: y(values[place]), r: 5 });
}
