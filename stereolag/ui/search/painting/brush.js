// A brush over the template. Nothing is sent until "Use this mask" is pressed.

const WIDEST = 420;
const FAR = 10;
const INK = [255, 0, 160];

export default function (component) {
  return shown(BrushPanel, component, (panel) => {
    panel.onMask = (value) => component.setTriggerValue("mask", value);
  });
}

class BrushPanel {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.stage = this.find(".stage");
    this.canvas = this.find("canvas");
    this.context = this.canvas.getContext("2d", { willReadFrequently: true });
    this.picture = new SentPicture(this.find("img"));
    this.size = this.find("input");
    this.modes = [...parent.querySelectorAll("[data-mode]")];
    for (const button of this.modes) button.addEventListener("click", () => this.choose(button.dataset.mode));
    this.size.addEventListener("input", () => this.showBrush());
    this.find(".own").addEventListener("click", () => this.begin(this.data.own));
    this.find(".use").addEventListener("click", () => this.use());
    const on = (type, react) => this.stage.addEventListener(type, react);
    on("pointerdown", (event) => this.press(event));
    on("pointermove", (event) => this.move(event));
    for (const type of ["pointerup", "pointercancel"]) on(type, () => this.lift());
    on("pointerleave", () => this.hideBrush());
    on("keydown", (event) => this.type(event));
    on("focus", () => this.showBrush());
    on("blur", () => this.hideBrush());
    this.resized = new ResizeObserver(() => this.lay());
    this.resized.observe(this.find(".painting"));
    this.choose("paint");
  }

  close() {
    this.resized.disconnect();
    this.picture.close();
  }

  load(data) {
    const told = JSON.stringify([data.name, data.own, data.used]);
    this.data = data;
    this.picture.await(data.name);
    if (told === this.told) return; // the page ran again: unsent paint stays
    this.told = told;
    const { rows, cols } = data;
    Object.assign(this.canvas, { width: cols, height: rows });
    const side = Math.max(rows, cols);
    this.size.max = Math.max(2, Math.round(side / 2));
    this.size.value = Math.max(1, Math.round(side / 10));
    this.at = [rows / 2, cols / 2];
    this.lay();
    this.begin(data.used);
  }

  begin(text) {
    const { rows, cols } = this.data;
    const painted = unpacked(text, rows * cols);
    const image = this.context.createImageData(cols, rows);
    painted.forEach((one, at) => one && image.data.set([...INK, 255], 4 * at));
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
    const mask = packed(painted, painted.length);
    this.find(".counts").textContent = `${shortened(left)} of ${shortened(painted.length)} pixels count`;
    this.find(".use").disabled = left < 2 || mask === this.data.used;
    this.mask = mask;
  }

  use() {
    this.find(".use").disabled = true;
    this.onMask(this.mask);
  }

  choose(mode) {
    this.mode = mode;
    for (const button of this.modes) button.setAttribute("aria-pressed", button.dataset.mode === mode);
  }

  lay() {
    if (!this.data) return;
    const { rows, cols } = this.data;
    const room = Math.min(this.find(".painting").clientWidth, WIDEST);
    if (!room) return; // collapsed
    this.scale = Math.min(room / cols, WIDEST / rows);
    Object.assign(this.stage.style, { width: `${cols * this.scale}px`, height: `${rows * this.scale}px` });
    this.find("output").textContent = `${this.size.value} px`;
  }

  place({ clientX, clientY }) {
    const { left, top } = this.stage.getBoundingClientRect();
    return [(clientY - top) / this.scale, (clientX - left) / this.scale];
  }

  press(event) {
    if (event.button || !this.scale) return;
    this.stage.setPointerCapture(event.pointerId);
    this.at = this.place(event);
    this.painting = true;
    this.stroke(this.at);
    this.showBrush();
  }

  move(event) {
    const before = this.at;
    this.at = this.place(event);
    if (this.painting) this.stroke(before);
    this.showBrush();
  }

  lift() {
    if (!this.painting) return;
    this.painting = false;
    this.count();
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

  type(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const far = event.shiftKey ? FAR : 1;
    const steps = { ArrowUp: [-far, 0], ArrowDown: [far, 0], ArrowLeft: [0, -far], ArrowRight: [0, far] };
    if (event.key === " ") {
      this.stroke(this.at);
      this.count();
    } else if (event.key in steps) {
      const [down, right] = steps[event.key];
      this.at = [clamp(this.at[0] + down, 0, this.data.rows), clamp(this.at[1] + right, 0, this.data.cols)];
      this.showBrush();
    } else return;
    event.preventDefault();
  }

  showBrush() {
    this.find("output").textContent = `${this.size.value} px`;
    const side = `${Number(this.size.value) * this.scale}px`;
    const [top, left] = this.at.map((value) => `${value * this.scale}px`);
    Object.assign(this.find(".brush").style, { display: "block", width: side, height: side, top, left });
  }

  hideBrush() {
    this.find(".brush").style.display = "none";
  }
}
