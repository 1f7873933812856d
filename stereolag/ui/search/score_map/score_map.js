// The score of every place, read under the pointer; a click compares it in the search by hand.

const STEP_FAR = 10;

export default function (component) {
  return shown(Panel, component);
}

class Panel {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.stage = this.find(".stage");
    this.stage.addEventListener("pointermove", (event) => this.hover(event));
    this.stage.addEventListener("pointerleave", () => this.read(this.chosen));
    this.stage.addEventListener("keydown", (event) => this.type(event));
    this.stage.addEventListener("pointerdown", (event) => this.read(this.blockAt(event)));
    this.stage.addEventListener("click", () => this.compare());
  }

  close() {
    this.turn = undefined;
  }

  async load(data) {
    const turn = (this.turn = {});
    const { header, pictures } = await unpacked(data);
    if (turn !== this.turn) return;
    const [shown, codes, offsets] = pictures;
    this.stage.setAttribute("aria-label", header.words.stage);
    put(this.find("canvas"), shown.data, shown.rows, shown.cols);
    const same = this.header && this.header.digest === header.digest;
    Object.assign(this, { header, map: scoresOf(codes, header.steps), offsets: offsets.data });
    if (!same) this.chosen = null;
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
    const box = this.stage.getBoundingClientRect();
    const { rows, cols } = this.map;
    const row = Math.floor(((event.clientY - box.top) / box.height) * rows);
    const col = Math.floor(((event.clientX - box.left) / box.width) * cols);
    return { row: clamp(row, 0, rows - 1), col: clamp(col, 0, cols - 1) };
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
    const detail = { name: this.header.name, ...this.place(this.block) };
    window.dispatchEvent(new CustomEvent("stereolag-place", { detail }));
  }

  type(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.map) return;
    const far = event.shiftKey ? STEP_FAR : 1;
    const steps = { ArrowUp: [-far, 0], ArrowDown: [far, 0], ArrowLeft: [0, -far], ArrowRight: [0, far] };
    if (event.key in steps) {
      const { rows, cols } = this.map;
      const from = this.block ?? { row: Math.floor(rows / 2), col: Math.floor(cols / 2) };
      const [down, right] = steps[event.key];
      this.chosen = { row: clamp(from.row + down, 0, rows - 1), col: clamp(from.col + right, 0, cols - 1) };
      this.read(this.chosen);
    } else if (event.key === "Enter" || event.key === " ") this.compare();
    else return;
    event.preventDefault();
  }
}
