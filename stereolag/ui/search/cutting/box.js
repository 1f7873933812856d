// A box over a picture. It is sent on release, or once no key has been pressed for a moment.

const REST_MS = 400;
const FAR = 10;
const HIGHEST = 0.7; // of the window's height

export default function (component) {
  return shown(BoxPanel, component, (panel) => {
    panel.onBox = (value) => component.setTriggerValue("box", value);
  });
}

class BoxPanel {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.stage = this.find(".stage");
    this.picture = new SentPicture(this.find("img"));
    this.inputs = [...parent.querySelectorAll("input")];
    const on = (type, react) => this.stage.addEventListener(type, react);
    on("pointerdown", (event) => this.grab(event));
    on("pointermove", (event) => this.drag(event));
    on("pointerup", () => this.release(true));
    on("pointercancel", () => this.release(false));
    on("keydown", (event) => this.type(event));
    for (const input of this.inputs) input.addEventListener("change", () => this.take());
    this.resized = new ResizeObserver(() => this.draw());
    this.resized.observe(this.find(".cutting"));
  }

  close() {
    this.resized.disconnect();
    this.picture.close();
    clearTimeout(this.waiting);
  }

  load(data) {
    this.data = data;
    this.picture.await(data.name);
    const told = JSON.stringify([data.name, data.box]);
    if (told === this.told) return; // the page ran again: a box being dragged stays
    this.told = told;
    this.box = { ...data.box };
    this.sent = JSON.stringify(this.box);
    this.draw();
  }

  // Moves or resizes the box, as far as the picture and the least side allow.
  fit({ row, col, height, width }) {
    const { rows, cols, least } = this.data;
    this.box.height = clamp(Math.round(height), Math.min(least, rows), rows);
    this.box.width = clamp(Math.round(width), Math.min(least, cols), cols);
    this.box.row = clamp(Math.round(row), 0, rows - this.box.height);
    this.box.col = clamp(Math.round(col), 0, cols - this.box.width);
    this.draw();
  }

  // Spans the box between two points, (row, col) each; the first stays fixed.
  span([row, col], [toRow, toCol]) {
    const { rows, cols, least } = this.data;
    const side = (from, to, end) => {
      const [low, high] = [clamp(Math.min(from, to), 0, end), clamp(Math.max(from, to), 0, end)];
      if (high - low >= least) return [low, high - low];
      const start = to < from ? from - least : from;
      return [clamp(start, 0, Math.max(0, end - least)), least];
    };
    const [top, height] = side(Math.round(row), Math.round(toRow), rows);
    const [left, width] = side(Math.round(col), Math.round(toCol), cols);
    this.fit({ row: top, col: left, height, width });
  }

  at({ clientX, clientY }) {
    const { left, top } = this.stage.getBoundingClientRect();
    return [(clientY - top) / this.scale, (clientX - left) / this.scale];
  }

  grab(event) {
    if (event.button || !this.scale) return;
    const corner = event.target.dataset.corner;
    const inside = event.target === this.find(".box");
    if (event.pointerType === "touch" && !corner && !inside) return; // a finger scrolls the page there
    const { row, col, height, width } = this.box;
    const [y, x] = this.at(event);
    this.before = { ...this.box };
    if (inside) this.held = ([toY, toX]) => this.fit({ ...this.before, row: row + toY - y, col: col + toX - x });
    else {
      const anchor = corner
        ? [corner[0] === "n" ? row + height : row, corner[1] === "w" ? col + width : col]
        : [y, x];
      // The pointer rarely grabs a corner at its exact point.
      const [slipY, slipX] = corner ? [y - (2 * row + height - anchor[0]), x - (2 * col + width - anchor[1])] : [0, 0];
      this.held = ([toY, toX]) => this.span(anchor, [toY - slipY, toX - slipX]);
    }
    this.stage.setPointerCapture(event.pointerId);
  }

  drag(event) {
    this.held?.(this.at(event));
  }

  release(kept) {
    if (!this.held) return;
    this.held = undefined;
    if (kept) this.send();
    else this.fit(this.before);
  }

  type(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const far = event.shiftKey ? FAR : 1;
    const { row, col, height, width } = this.box;
    const moves = {
      ArrowUp: { row: row - far },
      ArrowDown: { row: row + far },
      ArrowLeft: { col: col - far },
      ArrowRight: { col: col + far },
      "+": { row: row - 1, col: col - 1, height: height + 2, width: width + 2 },
      "-": { row: row + 1, col: col + 1, height: height - 2, width: width - 2 },
    };
    if (!(event.key in moves)) return;
    event.preventDefault();
    this.fit({ ...this.box, ...moves[event.key] });
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.send(), REST_MS);
  }

  take() {
    const typed = this.inputs.filter((input) => Number.isFinite(input.valueAsNumber));
    this.fit({ ...this.box, ...Object.fromEntries(typed.map((input) => [input.name, input.valueAsNumber])) });
    this.send();
  }

  send() {
    clearTimeout(this.waiting);
    const box = JSON.stringify(this.box);
    if (box === this.sent) return;
    this.sent = box;
    this.told = JSON.stringify([this.data.name, this.box]);
    this.onBox({ ...this.box });
  }

  draw() {
    if (!this.box) return;
    const { rows, cols } = this.data;
    const room = this.find(".cutting").clientWidth;
    if (!room) return;
    this.scale = Math.min(room / cols, (window.innerHeight * HIGHEST) / rows);
    Object.assign(this.stage.style, { width: `${cols * this.scale}px`, height: `${rows * this.scale}px` });
    const px = (value) => `${value * this.scale}px`;
    const { row, col, height, width } = this.box;
    Object.assign(this.find(".box").style, { left: px(col), top: px(row), width: px(width), height: px(height) });
    for (const input of this.inputs) input.value = this.box[input.name];
  }
}
