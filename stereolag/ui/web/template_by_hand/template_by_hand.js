// A template dragged over a picture, without server requests.

import { button, element, node, put, say } from "../shared/dom.js";
import { clamp, filled, shortened } from "../shared/numbers.js";
import { pixelsOf, scoresOf, unpacked } from "../shared/packing.js";
import { arrows, onDrag, onKey, Panel, show } from "../shared/panel.js";
import { eventOf } from "../shared/exchange.js";
import { colourOf, cutOut, drawRelief, inProductColours } from "./drawing.js";
import { compared, prepared } from "./scoring.js";

const SPOT = 3; // places on every side of a visited one that are painted with it

export default (component) => show(TemplatePanel, component);

class TemplatePanel extends Panel {
  constructor(parent) {
    super(parent, "by-hand");
    this.template = this.find(".held");
    this.map = this.find(".map");
    this.find(".reveal").addEventListener("click", () => this.reveal());
    this.find(".clear").addEventListener("click", () => this.clear());
    onKey(this.stage, (event) => this.search && arrows(event, (down, right) => this.move(this.row + down, this.col + right)));
    onDrag(this.stage, (event) => this.grab(event));
    this.stage.addEventListener("click", (event) => event.pointerType === "touch" && this.jump(event));
    this.map.addEventListener("click", (event) => this.point(event));
    this.listen(eventOf("place"), ({ detail }) => detail.name === this.search?.name && this.compare(detail));
    this.watchSize(this.root, () => this.drawReliefs());
  }

  async load(data) {
    const turn = (this.turn = {});
    const search = await searched(data);
    const same = search.digest === this.search?.digest; // the page ran again: the painting stays
    if (turn !== this.turn || this.gone.signal.aborted || same) return;
    this.search = search;
    const { words, picture, template, map } = search;
    this.colour({ frame: words.frame });
    for (const [name, text] of Object.entries(words.texts)) this.find(name).textContent = text;
    this.stage.setAttribute("aria-label", words.stage);
    put(this.find(".picture"), picture);
    for (const name of [".held canvas", ".template canvas"]) put(this.find(name), template);
    this.template.style.width = `${(100 * template.cols) / picture.cols}%`;
    this.template.style.height = `${(100 * template.rows) / picture.rows}%`;
    this.find(".map svg").setAttribute("viewBox", `0 0 ${map.cols} ${map.rows}`);
    this.row = Math.round((map.rows - 1) * 0.2);
    this.col = Math.round((map.cols - 1) * 0.2);
    this.clear();
  }

  clear() {
    if (!this.search) return;
    const { rows, cols } = this.search.map;
    this.painted = { rows, cols, data: new Uint8ClampedArray(4 * rows * cols) };
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
    const { data } = this.painted;
    if (data[4 * at + 3]) return;
    data.set(colourOf(this.search.map.scores[at], this.search.words.palette), 4 * at);
    data[4 * at + 3] = 255;
  }

  reveal() {
    if (!this.search) return;
    this.search.map.scores.forEach((_, at) => this.fill(at));
    this.revealed = true;
    this.showLeaders();
    this.schedule();
  }

  grab(event) {
    if (!this.search) return null;
    const touched = event.pointerType === "touch"; // outside the template a finger scrolls the page or taps
    if (touched && !this.template.contains(event.target)) return null;
    if (!touched) this.jump(event);
    const from = this.pixelAt(event);
    const [down, right] = [from.row - this.row, from.col - this.col];
    const move = (moved) => {
      const { row, col } = this.pixelAt(moved);
      this.move(row - down, col - right);
    };
    return { move };
  }

  // Brings the template under the pointer, unless it is already there.
  jump(event) {
    if (this.template.contains(event.target) || !this.search) return;
    const { row, col } = this.pixelAt(event);
    const { rows, cols } = this.search.template;
    this.move(row - rows / 2, col - cols / 2, { jump: true });
  }

  pixelAt(event, shown = this.stage, cols = this.search.picture.cols) {
    const box = shown.getBoundingClientRect();
    const scale = cols / box.width;
    return { row: (event.clientY - box.top) * scale, col: (event.clientX - box.left) * scale };
  }

  point(event) {
    if (!this.search) return;
    const { row, col } = this.pixelAt(event, this.map, this.search.map.cols);
    this.move(row - 0.5, col - 0.5, { jump: true });
  }

  // Compares at a place of the whole image, px.
  compare({ row, col }) {
    const { factor, row: top, col: left } = this.search;
    this.move((row - top) / factor, (col - left) / factor, { jump: true });
    this.find(".pieces").scrollIntoView({ block: "nearest" });
  }

  draw() {
    if (!this.search) return;
    const { picture, template, words, factor } = this.search;
    const { score, products } = compared(picture, template, this.row, this.col);
    this.template.style.left = `${(100 * this.col) / picture.cols}%`;
    this.template.style.top = `${(100 * this.row) / picture.rows}%`;
    put(this.find(".window canvas"), cutOut(picture, template, this.row, this.col));
    put(this.find(".products canvas"), inProductColours(template, products));
    put(this.find(".map canvas"), this.painted);
    this.find(".empty").hidden = this.moved || this.revealed;
    this.find(".score").textContent = shortened(score, 3);
    const row = this.search.row + this.row * factor;
    const col = this.search.col + this.col * factor;
    this.find(".where").textContent = filled(words.where, { row, col, score: shortened(score, 3) });
    this.drawMarks();
    say(this.find(".said"), this.revealed ? this.lesson() : "");
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
    const rings = [...places, ["now", this]].map(([kind, { row, col }]) =>
      node("circle", { class: kind, cx: col + 0.5, cy: row + 0.5, r: kind === "now" ? radius / 2 : radius }),
    );
    this.find(".map svg").replaceChildren(...rings);
  }

  showLeaders() {
    const { leaders, words } = this.search;
    const buttons = leaders.map((place, at) => {
      const one = button("", () => this.move(place.row, place.col, { jump: true }));
      one.title = words.go;
      one.append(element("canvas"), element("span", "", `${at ? words.rival : words.top} ${shortened(place.score, 3)}`));
      return one;
    });
    this.find(".leaders").replaceChildren(...buttons);
    this.drawReliefs();
  }

  drawReliefs() {
    if (!this.revealed) return;
    const { map, template, leaders, words } = this.search;
    const reach = clamp(Math.round(0.6 * Math.max(template.rows, template.cols)), 8, 20);
    this.findAll(".leaders canvas").forEach((canvas, at) => {
      if (canvas.clientWidth) drawRelief(canvas, map, leaders[at], reach, words.palette);
    });
  }
}

// Unpacks the data of stereolag.ui.packing.packed_search.
async function searched(data) {
  const { parts, ...header } = unpacked(data);
  const [picture, template, opaque, codes] = await Promise.all(parts.map(pixelsOf));
  const counts = Uint8Array.from({ length: opaque.rows * opaque.cols }, (_, at) => opaque.data[4 * at]);
  counts.forEach((value, at) => (template.data[4 * at + 3] = value));
  const sought = { ...prepared(template, counts), data: template.data };
  return { ...header, picture, template: sought, map: scoresOf(codes, header.steps) };
}
