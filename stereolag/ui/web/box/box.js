// A box over a picture. It is sent when it is released, or once no key has been pressed for a moment.

import { DrawingPanel } from "../shared/drawing.js";
import { clamp } from "../shared/numbers.js";
import { arrows } from "../shared/panel.js";

const REST_MS = 400;

export default class BoxPanel extends DrawingPanel {
  setUp() {
    super.setUp();
    this.atEnd(() => clearTimeout(this.resting));
  }

  begin(data) {
    super.begin(data);
    const told = JSON.stringify(data.box);
    if (told !== this.sent) this.box = { ...data.box }; // its own box coming back must not disturb a drag
    this.sent = told;
  }

  // Moves or resizes the box, as far as the picture and the smallest side allow.
  fit({ row, col, height, width }) {
    const { rows, cols, least } = this.data;
    this.box.height = clamp(Math.round(height), Math.min(least, rows), rows);
    this.box.width = clamp(Math.round(width), Math.min(least, cols), cols);
    this.box.row = clamp(Math.round(row), 0, rows - this.box.height);
    this.box.col = clamp(Math.round(col), 0, cols - this.box.width);
    this.render();
  }

  // Spans the box between two points, (row, col) each; the first stays fixed.
  span(fixed, held) {
    const side = (axis, end) => {
      const [from, to] = [Math.round(fixed[axis]), clamp(Math.round(held[axis]), 0, end)];
      const length = Math.max(Math.abs(to - from), this.data.least);
      return [to < from ? from - length : from, length];
    };
    const [[row, height], [col, width]] = [side(0, this.data.rows), side(1, this.data.cols)];
    this.fit({ row, col, height, width });
  }

  // Moves the box or one of its corners, or outside it spans a new box from where the pointer went down.
  grab(event) {
    const { corner } = event.target.dataset;
    const inside = event.target === this.find(".box");
    if (event.pointerType === "touch" && !corner && !inside) return null; // a finger scrolls the page there
    const before = { ...this.box };
    const { row, col, height, width } = before;
    const from = this.placeOf(event);
    const [rows, cols] = [[row, row + height], [col, col + width]];
    if (corner?.[0] === "n") rows.reverse();
    if (corner?.[1] === "w") cols.reverse();
    const [fixed, held] = corner ? [[rows[0], cols[0]], [rows[1], cols[1]]] : [from, from];
    const move = (moved) => {
      const [toRow, toCol] = this.placeOf(moved);
      const [down, right] = [toRow - from[0], toCol - from[1]]; // the pointer rarely grabs a corner at its exact point
      if (inside) this.fit({ ...before, row: row + down, col: col + right });
      else this.span(fixed, [held[0] + down, held[1] + right]);
    };
    const end = (released) => {
      if (released) this.send();
      else this.fit(before);
    };
    return { move, end };
  }

  actions(event) {
    const { row, col, height, width } = this.box;
    const change = (changed) => {
      this.fit({ ...this.box, ...changed });
      clearTimeout(this.resting);
      this.resting = setTimeout(() => this.send(), REST_MS);
    };
    return {
      ...arrows(event, (down, right) => change({ row: row + down, col: col + right })),
      "+": () => change({ row: row - 1, col: col - 1, height: height + 2, width: width + 2 }),
      "-": () => change({ row: row + 1, col: col + 1, height: height - 2, width: width - 2 }),
    };
  }

  take(name, number) {
    if (Number.isFinite(number)) this.fit({ ...this.box, [name]: number });
    else this.render();
    this.send();
  }

  send() {
    clearTimeout(this.resting);
    const box = JSON.stringify(this.box);
    if (box === this.sent) return;
    this.sent = box;
    this.trigger("box", { ...this.box });
  }
}
