// A brush over the template. Nothing is sent until "Use this mask" is pressed.

import { DrawingPanel } from "../shared/drawing.js";
import { clamp, total } from "../shared/numbers.js";
import { base64 } from "../shared/packing.js";
import { arrows } from "../shared/panel.js";

const INK = [255, 0, 160];
const DOT = 0.001; // px: a line of zero length would have no caps

export default class BrushPanel extends DrawingPanel {
  canvas = Object.assign(document.createElement("canvas"), { ariaHidden: "true" });
  context = this.canvas.getContext("2d", { willReadFrequently: true });
  at; // the row and column of the brush
  mode = "Paint";
  shown = false; // whether the brush is shown

  begin(data) {
    super.begin(data);
    const { rows, cols, used } = data;
    Object.assign(this.canvas, { width: cols, height: rows });
    const side = Math.max(rows, cols);
    this.widest = Math.max(2, Math.round(side / 2));
    this.size = Math.max(1, Math.round(side / 10));
    this.at = [rows / 2, cols / 2];
    this.paintAll(used);
  }

  paintAll(mask) {
    const { rows, cols } = this.data;
    const image = this.context.createImageData(cols, rows);
    unpacked(mask, rows * cols).forEach((painted, at) => painted && image.data.set([...INK, 255], 4 * at));
    this.context.putImageData(image, 0, 0);
    this.count();
  }

  // The brush has soft edges; a pixel counts as painted over if most of it is.
  count() {
    const { rows, cols } = this.data;
    const { data } = this.context.getImageData(0, 0, cols, rows);
    const painted = Uint8Array.from({ length: rows * cols }, (_, at) => (data[4 * at + 3] >= 128 ? 1 : 0));
    this.left = painted.length - total(painted);
    this.mask = packed(painted);
    this.sent = false;
    this.schedule();
  }

  use() {
    this.trigger("mask", this.mask);
    this.set({ sent: true });
  }

  press(event) {
    this.showBrush(this.placeOf(event));
    let before = this.at;
    const move = () => {
      this.stroke(before);
      before = this.at;
    };
    move();
    return { move, end: () => this.count() };
  }

  // Paints from a place to the brush, both snapped to the grid: between four pixels, a brush of 1 px covers half of none.
  stroke(from) {
    const { context, size } = this;
    const along = (place) => (size % 2 ? Math.floor(place) + 0.5 : Math.round(place));
    const [[row, col], [toRow, toCol]] = [from, this.at].map((place) => place.map(along));
    context.globalCompositeOperation = this.mode === "Erase" ? "destination-out" : "source-over";
    Object.assign(context, { strokeStyle: `rgb(${INK})`, lineWidth: size, lineCap: "round" });
    context.stroke(new Path2D(`M${col} ${row}L${toCol + DOT} ${toRow}`));
  }

  actions(event) {
    const { rows, cols } = this.data;
    const [row, col] = this.at;
    return {
      ...arrows(event, (down, right) => this.showBrush([clamp(row + down, 0, rows), clamp(col + right, 0, cols)])),
      " ": () => {
        this.stroke(this.at);
        this.count();
      },
    };
  }

  showBrush(at = this.at) {
    this.set({ at, shown: true });
  }
}

// A mask as text: one bit per pixel, row by row, 1 where the template counts; base64.

// Packs a mask from values that are above 0 where painted over.
export function packed(painted) {
  const bytes = new Uint8Array(Math.ceil(painted.length / 8));
  painted.forEach((value, at) => value || (bytes[at >> 3] |= 0x80 >> (at & 7)));
  return base64(bytes);
}

// Unpacks a mask to values that are 1 where painted over.
export function unpacked(text, length) {
  const bytes = atob(text);
  return Uint8Array.from({ length }, (_, at) => ((bytes.charCodeAt(at >> 3) >> (7 - (at & 7))) & 1 ? 0 : 1));
}
