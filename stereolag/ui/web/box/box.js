// A box over a picture. It is sent on release, or once no key has been pressed for a moment.

import { DrawingPanel } from "../shared/drawing.js";
import { clamp } from "../shared/numbers.js";
import { arrows, show } from "../shared/panel.js";

const REST_MS = 400;

export default (component) => show(BoxPanel, component, view);

class BoxPanel extends DrawingPanel {
  setUp() {
    super.setUp();
    this.atEnd(() => clearTimeout(this.resting));
  }

  begin(data) {
    super.begin(data);
    const told = JSON.stringify(data.box);
    if (told !== this.sent) this.box = { ...data.box }; // its own comes back: one that is being dragged stays
    this.sent = told;
  }

  // Moves or resizes the box, as far as the picture and the least side allow.
  fit({ row, col, height, width }) {
    const { rows, cols, least } = this.data;
    this.box.height = clamp(Math.round(height), Math.min(least, rows), rows);
    this.box.width = clamp(Math.round(width), Math.min(least, cols), cols);
    this.box.row = clamp(Math.round(row), 0, rows - this.box.height);
    this.box.col = clamp(Math.round(col), 0, cols - this.box.width);
    this.render();
  }

  /**
   * Spans the box between two points, (row, col) each; the first stays fixed.
   * @param {number[]} from
   * @param {number[]} to
   */
  span([row, col], [toRow, toCol]) {
    const { rows, cols, least } = this.data;
    const side = (from, to, end) => {
      const length = Math.max(Math.abs(clamp(to, 0, end) - from), least);
      return [to < from ? from - length : from, length];
    };
    const [top, height] = side(Math.round(row), Math.round(toRow), rows);
    const [left, width] = side(Math.round(col), Math.round(toCol), cols);
    this.fit({ row: top, col: left, height, width });
  }

  grab(event) {
    const corner = event.target.dataset.corner;
    const inside = event.target === this.find(".box");
    if (event.pointerType === "touch" && !corner && !inside) return null; // a finger scrolls the page there
    const before = { ...this.box };
    const move = inside ? this.moving(event) : this.spanning(event, corner);
    const end = (released) => {
      if (released) this.send();
      else this.fit(before);
    };
    return { move, end };
  }

  moving(event) {
    const { row, col } = this.box;
    const [fromRow, fromCol] = this.placeOf(event);
    return (moved) => {
      const [toRow, toCol] = this.placeOf(moved);
      this.fit({ ...this.box, row: row + toRow - fromRow, col: col + toCol - fromCol });
    };
  }

  // Spans from the opposite corner, or without a corner from where the pointer went down.
  spanning(event, corner) {
    const { row, col, height, width } = this.box;
    const from = this.placeOf(event);
    const anchor = corner ? [corner[0] === "n" ? row + height : row, corner[1] === "w" ? col + width : col] : from;
    // The pointer rarely grabs a corner at its exact point.
    const [slipRow, slipCol] = corner ? [from[0] - (2 * row + height - anchor[0]), from[1] - (2 * col + width - anchor[1])] : [0, 0];
    return (moved) => {
      const [toRow, toCol] = this.placeOf(moved);
      this.span(anchor, [toRow - slipRow, toCol - slipCol]);
    };
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
