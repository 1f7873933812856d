// A cut of recording 1, dragged over recording 2 without server requests.

import { shortened } from "../shared/numbers.js";
import { arrows, onDrag, onKey, show } from "../shared/panel.js";
import { VisitingPanel } from "../shared/visiting.js";
import { highest, measured } from "./products.js";
import { drawStrips, LEFT } from "./strips.js";

const PAGE = 10;

export default (component) => show(SlidingPanel, component);

class SlidingPanel extends VisitingPanel {
  constructor(parent) {
    super(parent);
    this.svg = this.find("svg");
    this.find(".normalise").addEventListener("change", () => this.measure());
    onDrag(this.stage, (event) => this.grab(event));
    onKey(this.stage, (event) => this.actions(event));
  }

  places() {
    return this.example.recording.length - this.example.cut.length + 1;
  }

  prepare() {
    this.stage.setAttribute("aria-valuemin", this.example.lag);
    this.stage.setAttribute("aria-valuemax", this.example.lag + (this.places() - 1) * this.example.step);
    this.find(".normalise").checked = false;
  }

  measure() {
    this.normalised = this.find(".normalise").checked;
    this.all = measured(this.example, this.normalised);
    this.schedule();
  }

  best() {
    return highest(this.all)[0];
  }

  grab(event) {
    if (!this.at) return null;
    this.pause();
    const sample = this.sampleAt(event);
    const length = this.example.cut.length;
    if (sample < this.place || sample >= this.place + length) this.move(sample - length / 2, { jump: true });
    const grip = sample - this.place;
    return { move: (moved) => this.move(this.sampleAt(moved) - grip) };
  }

  sampleAt(event) {
    return (event.clientX - this.svg.getBoundingClientRect().left - LEFT) / this.at.pitch;
  }

  actions(event) {
    const go = (place, how = {}) => {
      this.pause();
      this.move(place, how);
    };
    return {
      ...arrows(event, (down, right) => go(this.place + right - down), PAGE),
      PageDown: () => go(this.place - PAGE),
      PageUp: () => go(this.place + PAGE),
      Home: () => go(0, { jump: true }),
      End: () => go(this.visited.length - 1, { jump: true }),
      " ": () => this.toggle(),
    };
  }

  draw() {
    if (!this.all || !this.svg.clientWidth) return;
    const { words } = this.data;
    const { example, all, place, visited } = this;
    const named = { ...words, ...(this.normalised ? words.normalised : words.plain) };
    this.at = drawStrips(this.svg, example, all, { place, visited, words: named });
    const sum = shortened(all.sums[place], this.normalised ? 2 : example.whole ? 0 : 1);
    const lag = example.lag + place * example.step;
    const said = `${words.lag} ${shortened(lag)} · ${named.sum} ${sum}`;
    this.stage.setAttribute("aria-valuenow", lag);
    this.stage.setAttribute("aria-valuetext", said);
    this.tell(said, example.said[this.normalised ? "normalised" : "plain"]);
  }
}
