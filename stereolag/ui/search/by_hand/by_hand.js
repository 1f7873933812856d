// A template dragged over a picture, without server requests.

const STEP_FAR = 10;
const SPOT = 3; // places on every side of a visited one that are painted with it
const SVG = "http://www.w3.org/2000/svg";

export default function (component) {
  return shown(Panel, component);
}

class Panel {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.root = this.find(".by-hand");
    this.stage = this.find(".stage");
    this.held = this.find(".held");
    this.map = this.find(".map");
    this.find(".reveal").addEventListener("click", () => this.reveal());
    this.find(".clear").addEventListener("click", () => this.clear());
    this.stage.addEventListener("keydown", (event) => this.type(event));
    this.stage.addEventListener("pointerdown", (event) => this.grab(event));
    this.stage.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) this.stage.addEventListener(name, () => this.release());
    this.stage.addEventListener("click", (event) => event.pointerType === "touch" && this.jump(event));
    this.map.addEventListener("click", (event) => this.point(event));
    this.onPlace = ({ detail }) => detail.name === this.search?.name && this.compare(detail);
    window.addEventListener("stereolag-place", this.onPlace);
    this.resized = new ResizeObserver(() => this.drawReliefs());
    this.resized.observe(this.root);
  }

  close() {
    window.removeEventListener("stereolag-place", this.onPlace);
    this.resized.disconnect();
    this.turn = undefined;
  }

  async load(data) {
    const turn = (this.turn = {});
    const search = await searched(data);
    if (turn !== this.turn || search.digest === this.search?.digest) return; // the page ran again: the painting stays
    this.search = search;
    const { words, picture, template, map } = search;
    this.root.style.setProperty("--frame", words.frame);
    for (const [name, text] of Object.entries(words.texts)) this.find(name).textContent = text;
    this.stage.setAttribute("aria-label", words.stage);
    put(this.find(".picture"), picture.data, picture.rows, picture.cols);
    for (const name of [".held canvas", ".template canvas"]) put(this.find(name), template.data, template.rows, template.cols);
    this.held.style.width = `${(100 * template.cols) / picture.cols}%`;
    this.held.style.height = `${(100 * template.rows) / picture.rows}%`;
    const marks = this.find(".map svg");
    marks.setAttribute("viewBox", `0 0 ${map.cols} ${map.rows}`);
    marks.setAttribute("preserveAspectRatio", "none");
    this.row = Math.round((map.rows - 1) * 0.2);
    this.col = Math.round((map.cols - 1) * 0.2);
    this.clear();
  }

  clear() {
    if (!this.search) return;
    const { rows, cols } = this.search.map;
    this.painted = new Uint8ClampedArray(4 * rows * cols);
    this.revealed = false;
    this.moved = false;
    this.find(".leaders").replaceChildren();
    this.paint(this.row, this.col);
    this.schedule();
  }

  // Moves the template and paints every place on the way; `jump` skips the places between.
  move(row, col, { jump = false } = {}) {
    const { rows, cols } = this.search.map;
    const to = { row: clamp(Math.round(row), 0, rows - 1), col: clamp(Math.round(col), 0, cols - 1) };
    const [down, right] = [to.row - this.row, to.col - this.col];
    const steps = jump ? 1 : Math.max(1, Math.abs(down), Math.abs(right));
    for (let step = 1; step <= steps; step++) {
      this.paint(Math.round(this.row + (down * step) / steps), Math.round(this.col + (right * step) / steps));
    }
    Object.assign(this, to, { moved: true });
    this.schedule();
  }

  paint(row, col) {
    const { rows, cols } = this.search.map;
    for (let down = Math.max(0, row - SPOT); down <= Math.min(rows - 1, row + SPOT); down++) {
      for (let right = Math.max(0, col - SPOT); right <= Math.min(cols - 1, col + SPOT); right++) this.fill(down * cols + right);
    }
  }

  fill(at) {
    if (this.painted[4 * at + 3]) return;
    this.painted.set(colourOf(this.search.map.scores[at], this.search.words.palette), 4 * at);
    this.painted[4 * at + 3] = 255;
  }

  reveal() {
    if (!this.search) return;
    this.search.map.scores.forEach((_, at) => this.fill(at));
    this.revealed = true;
    this.showLeaders();
    this.schedule();
  }

  grab(event) {
    if (event.button || !this.search) return;
    const touched = event.pointerType === "touch"; // outside the template a finger scrolls the page or taps
    if (touched && !this.held.contains(event.target)) return;
    if (!touched) this.jump(event);
    const { row, col } = this.pixelAt(event);
    this.grip = { row: row - this.row, col: col - this.col };
    this.stage.setPointerCapture(event.pointerId);
    this.held.classList.add("dragging");
  }

  // Brings the template under the pointer, unless it is already there.
  jump(event) {
    if (this.held.contains(event.target) || !this.search) return;
    const { row, col } = this.pixelAt(event);
    const { rows, cols } = this.search.template;
    this.move(row - rows / 2, col - cols / 2, { jump: true });
  }

  drag(event) {
    if (!this.grip) return;
    const { row, col } = this.pixelAt(event);
    this.move(row - this.grip.row, col - this.grip.col);
  }

  release() {
    this.grip = undefined;
    this.held.classList.remove("dragging");
  }

  pixelAt(event) {
    const box = this.stage.getBoundingClientRect();
    const scale = this.search.picture.cols / box.width;
    return { row: (event.clientY - box.top) * scale, col: (event.clientX - box.left) * scale };
  }

  point(event) {
    if (!this.search) return;
    const box = this.map.getBoundingClientRect();
    const scale = this.search.map.cols / box.width;
    this.move((event.clientY - box.top) * scale - 0.5, (event.clientX - box.left) * scale - 0.5, { jump: true });
  }

  // Compares at a place of the whole image, px.
  compare({ row, col }) {
    const { factor, row: top, col: left } = this.search;
    this.move((row - top) / factor, (col - left) / factor, { jump: true });
    this.find(".pieces").scrollIntoView({ block: "nearest" });
  }

  type(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.search) return;
    const far = event.shiftKey ? STEP_FAR : 1;
    const steps = { ArrowUp: [-far, 0], ArrowDown: [far, 0], ArrowLeft: [0, -far], ArrowRight: [0, far] };
    if (!(event.key in steps)) return;
    const [down, right] = steps[event.key];
    this.move(this.row + down, this.col + right);
    event.preventDefault();
  }

  // At most once per frame, however often the pointer moves.
  schedule() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.draw();
    });
  }

  draw() {
    const { picture, template, map, words, factor } = this.search;
    const { score, products } = compared(picture, template, this.row, this.col);
    this.held.style.left = `${(100 * this.col) / picture.cols}%`;
    this.held.style.top = `${(100 * this.row) / picture.rows}%`;
    put(this.find(".window canvas"), cutOut(picture, template, this.row, this.col), template.rows, template.cols);
    put(this.find(".products canvas"), inProductColours(template, products), template.rows, template.cols);
    put(this.find(".map canvas"), this.painted, map.rows, map.cols);
    this.find(".empty").hidden = this.moved || this.revealed;
    this.find(".score").textContent = shortened(score, 3);
    const row = this.search.row + this.row * factor;
    const col = this.search.col + this.col * factor;
    this.find(".where").textContent = filled(words.where, { row, col, score: shortened(score, 3) });
    this.drawMarks();
    const said = this.revealed ? this.lesson() : "";
    if (said !== this.find(".said").textContent) this.find(".said").textContent = said; // read aloud once
  }

  lesson() {
    const { leaders, words, factor, row, col } = this.search;
    const [peak, rival] = leaders;
    if (!peak) return words.nothing;
    const values = { row: row + peak.row * factor, col: col + peak.col * factor, score: shortened(peak.score, 3) };
    return filled(words.peak, values) + (rival ? filled(words.lead, { rival: shortened(rival.score, 3) }) : "");
  }

  drawMarks() {
    const { map, leaders } = this.search;
    const radius = Math.max(7, map.cols / 50);
    const places = this.revealed ? leaders.map((place, at) => [at ? "rival" : "peak", place]) : [];
    const rings = [...places, ["now", this]].map(([kind, { row, col }]) => {
      const ring = document.createElementNS(SVG, "circle");
      const shape = { class: kind, cx: col + 0.5, cy: row + 0.5, r: kind === "now" ? radius / 2 : radius };
      for (const [name, value] of Object.entries(shape)) ring.setAttribute(name, value);
      return ring;
    });
    this.find(".map svg").replaceChildren(...rings);
  }

  showLeaders() {
    const { leaders, words } = this.search;
    const buttons = leaders.map((place, at) => {
      const button = Object.assign(document.createElement("button"), { type: "button", title: words.go });
      const name = document.createElement("span");
      name.textContent = `${at ? words.rival : words.top} ${shortened(place.score, 3)}`;
      button.append(document.createElement("canvas"), name);
      button.addEventListener("click", () => this.move(place.row, place.col, { jump: true }));
      return button;
    });
    this.find(".leaders").replaceChildren(...buttons);
    this.drawReliefs();
  }

  drawReliefs() {
    if (!this.revealed) return;
    const { map, template, leaders, words } = this.search;
    const reach = clamp(Math.round(0.6 * Math.max(template.rows, template.cols)), 8, 20);
    this.find(".leaders").querySelectorAll("canvas").forEach((canvas, at) => {
      if (canvas.clientWidth) drawRelief(canvas, map, leaders[at], reach, words.palette);
    });
  }
}

// Unpacks the data of stereolag.figures.template_by_hand.packed_search.
async function searched(data) {
  const { header, pictures } = await unpacked(data);
  const [picture, template, opaque, codes] = pictures;
  const counts = Uint8Array.from({ length: opaque.rows * opaque.cols }, (_, at) => opaque.data[4 * at]);
  counts.forEach((value, at) => (template.data[4 * at + 3] = value));
  const sought = { ...prepared(template, counts), data: template.data };
  return { ...header, picture, template: sought, map: scoresOf(codes, header.steps) };
}
