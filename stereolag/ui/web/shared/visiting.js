// Panels with examples to choose from. `VisitingPanel` also has places to visit one after the other, and Play, which visits
// them all; a panel adds its measurement and its drawing.

import { button, say, showPressed } from "./dom.js";
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
    this.place = this.start;
    this.visited = new Array(this.places()).fill(false);
    this.visited[this.place] = true;
    this.measure();
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
    if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.move(last);
      this.move(this.best());
      return;
    }
    const begun = performance.now();
    const go = (now) => {
      this.move(((now - begun) / 1000) * Math.min(PLACES_A_SECOND, this.visited.length / 3));
      if (this.place < last) this.playing = requestAnimationFrame(go);
      else {
        this.pause();
        this.move(this.best());
      }
    };
    this.playing = requestAnimationFrame(go);
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

  /** @returns {number} */
  places() { throw new Error("a panel says how many places it has"); }

  /** @returns {number} */
  best() { throw new Error("a panel says which place is the highest"); }

  prepare() {}

  measure() {}
}

// The runs of visited places, each a list of places.
export function runsOf(visited) {
  const runs = [];
  visited.forEach((seen, at) => {
    if (!seen) return;
    if (visited[at - 1]) runs.at(-1).push(at);
    else runs.push([at]);
  });
  return runs;
}

// The curve through the visited places; one visited alone is a dot.
export const pathOf = (runs, point) => runs.map((run) => `M${run.map(point).join("L")}${run.length === 1 ? "h0" : ""}`).join("");
