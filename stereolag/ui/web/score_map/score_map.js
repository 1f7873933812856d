// The score of every place, read under the pointer; a click compares that place in the search by hand.

import { placeIn, put } from "../shared/dom.js";
import { tell } from "../shared/exchange.js";
import { clamp, filled, shortened } from "../shared/numbers.js";
import { pixelsOf, scoresOf, unpacked } from "../shared/packing.js";
import { arrows, Panel } from "../shared/panel.js";

export default class ScoreMapPanel extends Panel {
  block = null; // the block of places whose score is shown; without one the hint is shown
  chosen = null; // the block shown while no pointer is there

  async load(data) {
    const turn = (this.turn = {});
    const { parts, ...header } = unpacked(data);
    const [shown, codes, offsets] = await Promise.all(parts.map(pixelsOf));
    if (turn !== this.turn || this.gone.signal.aborted) return;
    if (this.data?.digest !== header.digest) this.chosen = null;
    this.data = { ...header, ...scoresOf(codes, header.steps), offsets: offsets.data };
    this.set({ block: this.chosen });
    put(this.find("canvas"), shown);
  }

  // A resting pointer also sends moves when something below it changes; they must not undo a key press.
  hover(event) {
    const at = `${event.screenX} ${event.screenY}`;
    if (at !== this.rested) this.set({ block: this.blockAt(event) });
    this.rested = at;
  }

  blockAt(event) {
    return this.inside(...placeIn(event, this.stage, this.data));
  }

  inside(row, col) {
    return { row: clamp(Math.floor(row), 0, this.data.rows - 1), col: clamp(Math.floor(col), 0, this.data.cols - 1) };
  }

  reading() {
    const { words, cols, scores } = this.data;
    if (!this.block) return words.hint;
    const score = scores[this.block.row * cols + this.block.col];
    return filled(Number.isNaN(score) ? words.flat : words.reading, { ...this.best(), score: shortened(score, 3) });
  }

  // The best place of the block, px of the image.
  best() {
    const { factor, cols, offsets } = this.data;
    const { row, col } = this.block;
    const at = 4 * (row * cols + col);
    return { row: row * factor + offsets[at], col: col * factor + offsets[at + 1] };
  }

  compare() {
    if (!this.block) return;
    this.chosen = this.block;
    tell("place", { name: this.data.name, ...this.best() });
  }

  actions(event) {
    const from = this.block ?? this.inside(this.data.rows / 2, this.data.cols / 2);
    const step = (down, right) => {
      const block = this.inside(from.row + down, from.col + right);
      this.set({ block, chosen: block });
    };
    return { ...arrows(event, step), Enter: () => this.compare(), " ": () => this.compare() };
  }
}
