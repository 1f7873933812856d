// A visitor's input to the pictures: pointer, wheel, keys and buttons.

import { shareOf } from "../shared/dom.js";
import { clamp } from "../shared/numbers.js";
import { arrows, onKey, show } from "../shared/panel.js";
import { LinkedPictures } from "./pictures.js";

const DRAG_PX = 4;
const DOUBLE_CLICK_MS = 300;
const ZOOMS = { in: 1.5, out: 1 / 1.5, reset: 0 };
const ZOOM_KEYS = { "+": "in", "=": "in", "-": "out", 0: "reset" };

export default (component) => show(HandledPictures, component);

class HandledPictures extends LinkedPictures {
  constructor(parent) {
    super(parent);
    this.pointers = new Map();
    this.root.addEventListener("click", ({ target }) => {
      if (target.dataset.mode) {
        this.mode = target.dataset.mode;
        this.build();
      }
      if (target.dataset.zoom) this.zoomBy(ZOOMS[target.dataset.zoom]);
    });
    [".before", ".after"].forEach((name, side) => {
      this.find(name).addEventListener("change", ({ target }) => {
        this.pair[side] = target.value;
        this.build();
      });
    });
    this.listenToStage();
  }

  listenToStage() {
    const on = (type, react, options = {}) => this.stage.addEventListener(type, react, options);
    on("pointerdown", (event) => this.press(event));
    on("pointermove", (event) => this.move(event));
    on("pointerup", (event) => this.release(event));
    on("pointercancel", (event) => this.forget(event));
    on("pointerleave", () => this.point(null));
    on("blur", () => this.point(null));
    on("dblclick", (event) => this.cellOf(event) && this.zoomBy(0));
    on("wheel", (event) => this.roll(event), { passive: false });
    onKey(this.stage, (event) => event.target === this.stage && this.actions(event));
  }

  // Moves the crosshair to a pixel; `null` removes it.
  point(at) {
    this.at = at;
    this.draw();
  }

  // By position: while the pointer is captured, the target of every event is the stage.
  cellOf({ clientX, clientY }) {
    return this.cells?.find((cell) => {
      const box = cell.viewport.getBoundingClientRect();
      return clientX >= box.left && clientX < box.right && clientY >= box.top && clientY < box.bottom;
    });
  }

  // The pixel under the pointer, and the pointer's position in the view, 0..1.
  place(event, cell) {
    const [u, v] = shareOf(event, cell.viewport).map((share) => clamp(share, 0, 1));
    const { rows, cols } = this.header;
    const col = clamp(Math.floor(this.x + (u * cols) / this.zoom), 0, cols - 1);
    const row = clamp(Math.floor(this.y + (v * rows) / this.zoom), 0, rows - 1);
    return { row, col, u, v, width: cell.viewport.getBoundingClientRect().width };
  }

  press(event) {
    const cell = this.cellOf(event);
    if (!cell || event.button) return;
    this.pointers.set(event.pointerId, event);
    const { u, width } = this.place(event, cell);
    this.held = { cell, moved: false, onSplit: cell.moveSplit && Math.abs(u - this.split / 100) * width < 16 };
    if (event.pointerType === "mouse" || this.zoom > 1) this.stage.setPointerCapture(event.pointerId);
  }

  move(event) {
    const cell = this.held?.cell ?? this.cellOf(event);
    const last = this.pointers.get(event.pointerId);
    if (last && this.held) this.drag(event, last);
    this.point(cell ? this.place(event, cell) : null);
  }

  drag(event, last) {
    const [dx, dy] = [event.clientX - last.clientX, event.clientY - last.clientY];
    if (!this.held.moved && Math.hypot(dx, dy) < DRAG_PX) return;
    this.held.moved = true;
    const { u, v, width } = this.place(event, this.held.cell);
    if (this.held.onSplit) this.held.cell.moveSplit(u * 100);
    else if (this.pointers.size === 2) {
      const other = [...this.pointers.values()].find((one) => one.pointerId !== event.pointerId);
      const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      this.zoomBy(apart(event) / Math.max(1, apart(last)), u, v);
    } else {
      const pixel = this.header.cols / this.zoom / width;
      this.x -= dx * pixel;
      this.y -= dy * pixel;
    }
    this.root.classList.toggle("dragging", this.zoom > 1);
    this.pointers.set(event.pointerId, event);
  }

  release(event) {
    const held = this.held;
    this.forget(event);
    // The second click of a double click resets the zoom and must not pick again.
    const again = event.timeStamp - (this.lastPick ?? -1e9) < DOUBLE_CLICK_MS;
    if (!held || held.moved || !this.pictures[held.cell.indices[0]].pickable || again) return;
    this.lastPick = event.timeStamp;
    this.pick(this.place(event, held.cell));
  }

  pick({ row, col }) {
    this.trigger("picked", { row, col });
  }

  forget(event) {
    this.pointers.delete(event.pointerId);
    if (!this.pointers.size) this.held = null;
    this.root.classList.remove("dragging");
  }

  roll(event) {
    const cell = this.cellOf(event);
    // The wheel is left to the page unless the pictures have been clicked on, and when zooming out from whole pictures.
    const meant = event.ctrlKey || event.metaKey || this.stage.getRootNode().activeElement === this.stage;
    if (!cell || !meant || (event.deltaY > 0 && this.zoom === 1 && !event.ctrlKey)) return;
    event.preventDefault();
    const { u, v } = this.place(event, cell);
    this.zoomBy(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.002)), u, v);
  }

  actions(event) {
    const zooms = Object.entries(ZOOM_KEYS).map(([key, name]) => [key, () => this.zoomBy(ZOOMS[name], ...this.shareOfCross())]);
    const { at } = this;
    const pick = at && this.pictures.some((one) => one.pickable) ? () => this.pick(at) : undefined;
    return { ...arrows(event, (down, right) => this.step(down, right)), ...Object.fromEntries(zooms), Enter: pick, " ": pick };
  }

  // Moves the crosshair, and the zoomed view so that it stays inside.
  step(down, right) {
    const { rows, cols } = this.header;
    const from = this.at ?? this.marks.find((mark) => !mark.height && !mark.to) ?? { row: rows >> 1, col: cols >> 1 };
    const [row, col] = [clamp(from.row + down, 0, rows - 1), clamp(from.col + right, 0, cols - 1)];
    this.x = clamp(this.x, col + 1 - cols / this.zoom, col);
    this.y = clamp(this.y, row + 1 - rows / this.zoom, row);
    this.point({ row, col });
  }

  shareOfCross() {
    if (!this.at) return [0.5, 0.5];
    const { rows, cols } = this.header;
    return [((this.at.col - this.x) * this.zoom) / cols, ((this.at.row - this.y) * this.zoom) / rows];
  }
}
