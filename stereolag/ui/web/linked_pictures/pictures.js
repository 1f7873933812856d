// Pictures of one scene with a common crosshair: zoomed and moved together, read under the cursor, clickable.
// Rows and columns are those of the whole picture, whatever share of its pixels was sent.

import { button, described, element, emptied, node, showPressed } from "../shared/dom.js";
import { eventOf, received, tell } from "../shared/exchange.js";
import { legend } from "../shared/legend.js";
import { clamp } from "../shared/numbers.js";
import { Panel } from "../shared/panel.js";
import { contentOf, drawMark, drawOutlines, figures, fill, forget, picture, surface, textsAt } from "./drawing.js";

const CLOSEST_PX = 12;
const SIDES = [".before", ".after"];
const HINT =
  "Drag to move, double-click for the whole image; click first, and the wheel zooms. Arrow keys move the crosshair";

export class LinkedPictures extends Panel {
  constructor(parent) {
    super(parent, "linked");
    this.mode = "grid";
    this.pair = null;
    this.split = 50;
    this.zoom = 1;
    this.x = this.y = 0;
    this.at = null;
    this.marks = [];
    this.enlarged = new Set();
    this.contents = new Map();
    this.listen(eventOf("marks"), ({ detail }) => detail.name === this.name && this.setMarks(detail.item.marks));
    this.listen(eventOf("description"), ({ detail }) => detail.name === this.name && this.describe());
    this.listen(eventOf("pictures"), ({ detail }) => {
      this.renew(detail);
      this.describe();
    });
    this.listen(eventOf("preview"), ({ detail }) => detail.name === this.name && this.preview(detail));
    this.watchSize(this.stage, () => this.draw());
  }

  close() {
    super.close();
    this.contents.forEach(forget);
  }

  load(name) {
    this.name = name;
    this.describe();
  }

  // Shows the pictures of the latest description as soon as all have arrived.
  async describe() {
    const data = received("description", this.name);
    if (!data || data === this.header) return;
    if (!data.pictures.every(({ digest }) => this.contents.has(digest) || received("pictures", digest))) return;
    const contents = data.pictures.map(({ digest }) => this.content(digest));
    await Promise.all(contents.map((one) => one.ready));
    if (data !== received("description", this.name)) return; // a newer set overtook this one
    const sameScene = this.header?.rows === data.rows && this.header?.cols === data.cols;
    this.header = data;
    this.pictures = data.pictures.map((one, index) => picture(one, contents[index], data.colours));
    const shown = new Set(data.pictures.map(({ digest }) => digest));
    for (const [digest, one] of this.contents) {
      if (shown.has(digest)) continue;
      this.contents.delete(digest);
      forget(one);
    }
    if (!sameScene) Object.assign(this, { zoom: 1, x: 0, y: 0, at: null });
    this.marks = data.marks;
    this.build();
  }

  // The picture that arrived under a digest, unpacked once.
  content(digest) {
    if (!this.contents.has(digest)) this.contents.set(digest, contentOf(received("pictures", digest)));
    return this.contents.get(digest);
  }

  // Shows a map that replaces another at once; its description follows with the next `load`.
  renew({ name: digest, before, item }) {
    const index = this.pictures?.findIndex((one) => one.digest === before && !one.image) ?? -1;
    if (index < 0 || !item || this.content(digest).image) return;
    this.pictures[index] = picture({ ...this.pictures[index], digest }, this.content(digest), this.header.colours);
    this.show(index);
  }

  // Shows a map in place of that with its title until that is renewed, and its figures if it has any; without parts, that
  // one again.
  preview(item) {
    const index = this.pictures?.findIndex((one) => one.title === item.title) ?? -1;
    const one = this.pictures?.[index];
    if (!one) return;
    const content = item.parts.length && (this.contents.get(item.digest) ?? contentOf(item));
    if (item.whole) this.contents.set(item.digest, content); // its description is on its way
    const shown = content ? picture({ ...one, digest: item.digest }, content, one.colours) : one;
    if (item.live) this.pictures[index] = shown; // its values are read under the pointer
    this.show(index, shown);
    this.showFigures(index, item.figures ?? one.figures);
    if (item.live) this.draw();
  }

  setMarks(marks) {
    this.marks = marks;
    this.draw();
  }

  // Lays the pictures out, unless the layout is unchanged.
  build() {
    if (this.layout() !== this.laidOut) this.layOut();
    this.laidOut = this.layout();
    const pickable = this.pictures.some((one) => one.pickable);
    this.find(".legends").replaceChildren(...this.header.legends.map(legend));
    this.find(".hint").textContent = [this.header.hint, `${HINT}${pickable ? ", Enter picks." : "."}`].filter(Boolean).join(" ");
    this.refresh();
  }

  // Everything that determines the layout, as text.
  layout() {
    const { rows, cols, columns } = this.header;
    const places = this.pictures.map((one) => [one.title, one.thumbnail, this.isLarge(one), !one.image, one.figures.length]);
    return JSON.stringify([rows, cols, columns, this.mode, this.pair, places]);
  }

  layOut() {
    const titles = this.pictures.map((one) => one.title);
    const kept = this.pair?.map((title) => titles.indexOf(title));
    const [before, after] = kept && !kept.includes(-1) ? kept : [0, Math.min(1, titles.length - 1)];
    this.pair = [titles[before], titles[after]];
    SIDES.forEach((name, side) => {
      const select = this.find(name);
      select.replaceChildren(...titles.map((title) => new Option(title, title)));
      select.value = this.pair[side];
    });
    this.root.classList.toggle("slider", this.mode === "slider");
    this.find(".modes").hidden = titles.length < 2;
    showPressed(this.findAll("[data-mode]"), (one) => one.dataset.mode === this.mode);
    this.stage.style.setProperty("--columns", this.header.columns);
    const large = [...this.pictures.keys()].filter((index) => this.isLarge(this.pictures[index]));
    this.cells = this.mode === "slider" ? [this.cell(before, after)] : large.map((index) => this.cell(index));
    this.stage.replaceChildren(...this.cells.map((cell) => cell.figure));
    this.thumbnails = [...this.pictures.keys()].filter((index) => this.pictures[index].thumbnail);
    this.find(".thumbnails").replaceChildren(...this.thumbnails.map((index) => this.thumbnail(this.pictures[index])));
  }

  // Updates the pictures and their figures in the present layout.
  refresh() {
    this.pictures.forEach((one, index) => {
      this.show(index);
      this.showFigures(index, one.figures);
    });
    this.draw();
  }

  showFigures(index, all) {
    for (const cell of this.cells) if (cell.indices[0] === index) cell.figures?.replaceChildren(...figures(all));
  }

  // Updates one picture wherever it is shown.
  show(index, one = this.pictures[index]) {
    for (const { indices, layers } of this.cells) {
      layers.forEach((layer, side) => indices[side] === index && fill(layer.firstChild, one));
    }
    const small = this.find(".thumbnails").children[this.thumbnails.indexOf(index)];
    if (small) fill(small.firstChild, one);
  }

  cell(...indices) {
    const layers = indices.map((index) => element("div", "layer", surface(this.pictures[index])));
    const svg = node("svg", { preserveAspectRatio: "none", "aria-hidden": true });
    const viewport = element("div", "viewport", ...layers, svg);
    viewport.style.aspectRatio = `${this.header.cols} / ${this.header.rows}`;
    const readings = indices.map(() => element("p", "reading"));
    const caption = element("figcaption", "", ...indices.map((index) => element("span", "", this.pictures[index].title)));
    const below = indices.length > 1 || !this.pictures[indices[0]].figures.length ? null : element("dl", "figures");
    const figure = element("figure", "", caption, viewport, element("div", "readings", ...readings), ...(below ? [below] : []));
    const cell = { indices, figure, viewport, svg, layers, readings, figures: below, moveSplit: null };
    if (indices.length > 1) this.addSplit(cell);
    return cell;
  }

  isLarge(one) {
    return !one.thumbnail || this.enlarged.has(one.title);
  }

  // A small picture; a click adds it to the large ones or removes it from them.
  thumbnail(one) {
    const title = described(element("span", "", one.title), { "aria-hidden": true }); // the picture has the same label
    const large = this.isLarge(one);
    const small = button([surface(one), title], () => {
      if (!this.enlarged.delete(one.title)) this.enlarged.add(one.title);
      const place = [...small.parentElement.children].indexOf(small);
      this.build();
      this.find(".thumbnails").children[place]?.focus({ preventScroll: true }); // the button was replaced
    });
    small.title = large ? "Make it small again" : "Enlarge";
    small.setAttribute("aria-pressed", large);
    return small;
  }

  addSplit(cell) {
    const edge = element("div", "edge");
    const label = "How much of the image on the left is seen";
    const slider = element("input", "split");
    described(slider, { type: "range", min: 0, max: 100, step: 0.1, "aria-label": label });
    cell.moveSplit = (share) => {
      this.split = slider.value = clamp(share, 0, 100);
      edge.style.left = `${this.split}%`;
      cell.layers[1].style.clipPath = `inset(0 0 0 ${this.split}%)`;
    };
    slider.addEventListener("input", () => cell.moveSplit(Number(slider.value)));
    cell.viewport.append(edge);
    cell.viewport.after(slider);
    cell.moveSplit(this.split);
  }

  draw() {
    if (!this.cells) return;
    const { rows, cols, name, outlines } = this.header;
    // Announces the position of the crosshair: {row, col}, or null without one.
    if (this.at !== this.told) tell("crosshair", { name, at: (this.told = this.at) });
    this.x = clamp(this.x, 0, cols - cols / this.zoom);
    this.y = clamp(this.y, 0, rows - rows / this.zoom);
    this.root.classList.toggle("zoomed", this.zoom > 1);
    this.find("[data-zoom=reset]").textContent = `${this.zoom < 9.95 ? +this.zoom.toFixed(1) : Math.round(this.zoom)}×`;
    const points = this.marks.filter((mark) => !mark.height && !mark.to);
    const read = this.at ?? points.at(-1) ?? null;
    this.find(".where").textContent = read ? `row ${read.row}, column ${read.col}` : "";
    for (const cell of this.cells) this.drawCell(cell, read, outlines);
  }

  drawCell({ indices, viewport, svg, layers, readings }, read, outlines) {
    const { rows, cols, step } = this.header;
    const width = viewport.clientWidth;
    const view = `${this.x} ${this.y} ${cols / this.zoom} ${rows / this.zoom}`;
    viewport.classList.toggle("near", (width * this.zoom) / cols > 3);
    layers.forEach((layer, side) => {
      layer.firstChild.style.transform =
        `scale(${this.zoom}) translate(${(-this.x / cols) * 100}%, ${(-this.y / rows) * 100}%)`;
      drawOutlines(layer, this.pictures[indices[side]].image ? "" : outlines, view);
    });
    svg.setAttribute("viewBox", view);
    const add = emptied(svg);
    for (const mark of this.marks) {
      if (!mark.pictures.length || mark.pictures.includes(indices[0])) drawMark(add, mark, cols / this.zoom / (width || 1));
    }
    if (this.at) {
      const d = `M0 ${this.at.row + 0.5}H${cols}M${this.at.col + 0.5} 0V${rows}`;
      for (const name of ["cross-halo", "cross"]) add("path", { class: name, d });
    }
    indices.forEach((index, side) => {
      const texts = read ? textsAt(this.pictures[index], read, step) : [];
      readings[side].replaceChildren(...texts.flatMap((text, at) => (at ? [" · ", element("span", "faint", text)] : [element("span", "", text)])));
    });
  }

  // Zooms about the point (u, v) of the view, each 0..1, which stays fixed; a factor of 0 shows the whole picture.
  zoomBy(factor, u = 0.5, v = 0.5) {
    const { rows, cols } = this.header;
    const zoom = clamp(this.zoom * factor, 1, Math.max(1, cols / CLOSEST_PX));
    this.x += u * cols * (1 / this.zoom - 1 / zoom);
    this.y += v * rows * (1 / this.zoom - 1 / zoom);
    this.zoom = zoom;
    this.draw();
  }
}
