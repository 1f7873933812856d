// A brush over the template. Nothing is sent until "Use this mask" is pressed.

import { showPressed } from "../shared/dom.js";
import { DrawingPanel } from "../shared/drawing.js";
import { clamp, shortened } from "../shared/numbers.js";
import { arrows, onDrag, onKey, show } from "../shared/panel.js";

const WIDEST = 420;
const INK = [255, 0, 160];

export default (component) => show(BrushPanel, component);

class BrushPanel extends DrawingPanel {
  constructor(parent) {
    super(parent, "painting");
    this.canvas = this.find("canvas");
    this.context = this.canvas.getContext("2d", { willReadFrequently: true });
    this.size = this.find("input");
    for (const one of this.findAll("[data-mode]")) one.addEventListener("click", () => this.choose(one.dataset.mode));
    this.size.addEventListener("input", () => this.showBrush());
    this.find(".own").addEventListener("click", () => this.paintAll(this.data.own));
    this.find(".use").addEventListener("click", () => this.use());
    this.stage.addEventListener("pointermove", (event) => this.showBrush(this.placeOf(event)));
    this.stage.addEventListener("focus", () => this.showBrush());
    const hide = () => (this.find(".brush").style.display = "none");
    for (const type of ["pointerleave", "blur"]) this.stage.addEventListener(type, hide);
    onDrag(this.stage, (event) => this.press(event));
    onKey(this.stage, (event) => this.actions(event));
    this.choose("paint");
  }

  begin({ name, rows, cols, used }) {
    this.showPicture(name);
    Object.assign(this.canvas, { width: cols, height: rows });
    const side = Math.max(rows, cols);
    this.size.max = Math.max(2, Math.round(side / 2));
    this.size.value = Math.max(1, Math.round(side / 10));
    this.at = [rows / 2, cols / 2];
    this.draw();
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
  painted() {
    const { rows, cols } = this.data;
    const { data } = this.context.getImageData(0, 0, cols, rows);
    return Uint8Array.from({ length: rows * cols }, (_, at) => (data[4 * at + 3] >= 128 ? 1 : 0));
  }

  count() {
    const painted = this.painted();
    const left = painted.length - painted.reduce((sum, one) => sum + one, 0);
    this.mask = packed(painted);
    this.find(".counts").textContent = `${shortened(left)} of ${shortened(painted.length)} pixels count`;
    this.find(".use").disabled = left < 2 || this.mask === this.data.used;
  }

  use() {
    this.find(".use").disabled = true;
    this.trigger("mask", this.mask);
  }

  choose(mode) {
    this.mode = mode;
    showPressed(this.findAll("[data-mode]"), (one) => one.dataset.mode === mode);
  }

  draw() {
    if (!this.data || !this.fitStage(Math.min(this.root.clientWidth, WIDEST), WIDEST)) return;
    this.find("output").textContent = `${this.size.value} px`;
  }

  press(event) {
    if (!this.scale) return null;
    this.showBrush(this.placeOf(event));
    let before = this.at;
    const move = () => {
      this.stroke(before);
      before = this.at;
    };
    move();
    return { move, end: () => this.count() };
  }

  // Paints from a place to the brush. By the standard, a line of zero length has no caps, so a dot is drawn as a disc.
  stroke([row, col]) {
    const { context } = this;
    const [toRow, toCol] = this.at;
    const width = Number(this.size.value);
    context.globalCompositeOperation = this.mode === "erase" ? "destination-out" : "source-over";
    Object.assign(context, { strokeStyle: `rgb(${INK})`, fillStyle: `rgb(${INK})`, lineWidth: width, lineCap: "round" });
    context.beginPath();
    if (row === toRow && col === toCol) {
      context.arc(col, row, width / 2, 0, 2 * Math.PI);
      context.fill();
    } else {
      context.moveTo(col, row);
      context.lineTo(toCol, toRow);
      context.stroke();
    }
    context.globalCompositeOperation = "source-over";
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
    this.at = at;
    this.find("output").textContent = `${this.size.value} px`;
    const side = `${Number(this.size.value) * this.scale}px`;
    const [top, left] = at.map((value) => `${value * this.scale}px`);
    Object.assign(this.find(".brush").style, { display: "block", width: side, height: side, top, left });
  }
}

// A mask as text: one bit per pixel, row by row, 1 where the template counts; base64.

// Packs values that are above 0 where painted over.
export function packed(painted) {
  const bytes = new Uint8Array(Math.ceil(painted.length / 8));
  painted.forEach((value, at) => value || (bytes[at >> 3] |= 0x80 >> (at & 7)));
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}

// Unpacks a mask to values that are 1 where painted over.
export function unpacked(text, length) {
  const bytes = atob(text);
  return Uint8Array.from({ length }, (_, at) => ((bytes.charCodeAt(at >> 3) >> (7 - (at & 7))) & 1 ? 0 : 1));
}
