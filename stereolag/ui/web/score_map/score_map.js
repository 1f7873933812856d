// The score of every place, read under the pointer; a click compares it in the search by hand.

import { put, shareOf } from "../shared/dom.js";
import { tell } from "../shared/exchange.js";
import { clamp, filled, shortened } from "../shared/numbers.js";
import { pixelsOf, scoresOf, unpacked } from "../shared/packing.js";
import { arrows, onKey, Panel, show } from "../shared/panel.js";

export default (component) => show(ScoreMapPanel, component);

class ScoreMapPanel extends Panel {
  constructor(parent) {
    super(parent, "score-map");
    this.stage.addEventListener("pointermove", (event) => this.hover(event));
    this.stage.addEventListener("pointerleave", () => this.read(this.chosen));
    this.stage.addEventListener("pointerdown", (event) => this.read(this.blockAt(event)));
    this.stage.addEventListener("click", () => this.compare());
    onKey(this.stage, (event) => this.map && {
      ...arrows(event, (down, right) => this.step(down, right)),
      Enter: () => this.compare(),
      " ": () => this.compare(),
    });
  }

  async load(data) {
    const turn = (this.turn = {});
    const { parts, ...header } = unpacked(data);
    const [shown, codes, offsets] = await Promise.all(parts.map(pixelsOf));
    if (turn !== this.turn || this.gone.signal.aborted) return;
    this.stage.setAttribute("aria-label", header.words.stage);
    put(this.find("canvas"), shown);
    if (this.header?.digest !== header.digest) this.chosen = null;
    this.header = header;
    this.map = scoresOf(codes, header.steps);
    this.offsets = offsets.data;
    this.read(this.chosen);
  }

  // A resting pointer also sends moves when something below it changes; they must not undo a key press.
  hover(event) {
    const at = `${event.screenX} ${event.screenY}`;
    if (at !== this.rested) this.read(this.blockAt(event));
    this.rested = at;
  }

  blockAt(event) {
    if (!this.map) return null;
    const [right, down] = shareOf(event, this.stage);
    return this.inside(down * this.map.rows, right * this.map.cols);
  }

  inside(row, col) {
    return { row: clamp(Math.floor(row), 0, this.map.rows - 1), col: clamp(Math.floor(col), 0, this.map.cols - 1) };
  }

  // Writes the score at a block of places; `null` writes the hint.
  read(block) {
    if (!this.map) return;
    this.block = block;
    const { words } = this.header;
    const cross = this.find(".cross");
    cross.hidden = !block;
    if (!block) {
      this.find(".reading").textContent = words.hint;
      return;
    }
    const { rows, cols, scores } = this.map;
    cross.style.left = `${(100 * (block.col + 0.5)) / cols}%`;
    cross.style.top = `${(100 * (block.row + 0.5)) / rows}%`;
    const score = scores[block.row * cols + block.col];
    const text = Number.isNaN(score) ? words.flat : words.reading;
    this.find(".reading").textContent = filled(text, { ...this.place(block), score: shortened(score, 3) });
  }

  // The best place of a block, px of the image.
  place({ row, col }) {
    const { factor } = this.header;
    const at = 4 * (row * this.map.cols + col);
    return { row: row * factor + this.offsets[at], col: col * factor + this.offsets[at + 1] };
  }

  compare() {
    if (!this.block) return;
    this.chosen = this.block;
    tell("place", { name: this.header.name, ...this.place(this.block) });
  }

  step(down, right) {
    const from = this.block ?? this.inside(this.map.rows / 2, this.map.cols / 2);
    this.chosen = this.inside(from.row + down, from.col + right);
    this.read(this.chosen);
  }
}
