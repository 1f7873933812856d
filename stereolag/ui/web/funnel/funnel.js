// The steps of the "sampled" search for any picked pixel of the template, without server requests.

import { placeIn, shareOf } from "../shared/dom.js";
import { clamp, filled, shortened } from "../shared/numbers.js";
import { arrows, Panel } from "../shared/panel.js";

export default class FunnelPanel extends Panel {
  begin({ anchors: [first, ...others] }) {
    this.sorted = first ? [first, ...others].sort((one, other) => one.counts[1] - other.counts[1]) : [];
    this.reached = 0;
    this.anchor = first; // the one used by the search
  }

  pick(place) {
    this.set({ anchor: this.sorted[clamp(place, 0, this.sorted.length - 1)] });
  }

  pickBar(event) {
    this.pick(Math.floor(shareOf(event, event.currentTarget)[0] * this.sorted.length));
  }

  // Picks the nearest pixel that can be picked.
  pickPixel(event) {
    const { height: rows, width: cols } = this.data;
    const [row, col] = placeIn(event, event.currentTarget, { rows, cols });
    const far = this.sorted.map((anchor) => Math.hypot(anchor.row + 0.5 - row, anchor.col + 0.5 - col));
    this.pick(far.indexOf(Math.min(...far)));
  }

  actions(event) {
    const steps = arrows(event, (down, right) => this.pick(this.at + right - down), 1);
    return { ...steps, Home: () => this.pick(0), End: () => this.pick(Infinity) };
  }

  get at() {
    return this.sorted.indexOf(this.anchor);
  }

  // The best place, once it is reached.
  get best() {
    return this.reached === 3 && this.anchor.best;
  }

  named() {
    const { row, col, counts } = this.anchor;
    return filled(this.data.words.colour, { row, col, count: shortened(counts[1]) });
  }

  said() {
    const { anchor, reached, best, data: { words } } = this;
    const outcome = () => {
      if (!reached) return "";
      if (!anchor.counts[reached]) return words.none;
      const shown = anchor.dots[reached - 1].length;
      if (reached < 3) return shown < anchor.counts[reached] ? filled(words.some, { shown: shortened(shown) }) : "";
      if (!best) return words.many;
      const [row, col, score] = best;
      return filled(words.best, { row, col, score: shortened(score, 3) });
    };
    return filled(words.said[reached], { scored: shortened(anchor.scored) }) + outcome();
  }

  dots() {
    return this.anchor.dots[this.reached - 1].map(([row, col]) => `M${col + 0.5} ${row + 0.5}h0`).join("");
  }
}
