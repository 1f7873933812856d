// Pictures of one scene with a common crosshair: zoomed and moved together, read under the cursor, clickable.
// Rows and columns are those of the whole picture, whatever share of its pixels was sent.

import { shareOf } from "../shared/dom.js";
import { eventOf, received, tell } from "../shared/exchange.js";
import { clamp } from "../shared/numbers.js";
import { arrows, Panel } from "../shared/panel.js";
import { contentOf, forget, paint, picture, shapeOf, surface, textsAt } from "./drawing.js";

const CLOSEST_PX = 12;
const HINT =
  "Drag to move, double-click for the whole image; click first, and the wheel zooms. Arrow keys move the crosshair";
const DRAG_PX = 4;
const ZOOMS = { "+": 1.5, "=": 1.5, "-": 1 / 1.5, 0: 0 };

export default class LinkedPictures extends Panel {
  mode = "grid";
  pair = ["", ""]; // the titles of the pictures compared in the mode "slider"
  split = 50;
  zoom = 1;
  x = 0;
  y = 0;
  at = null; // the pixel of the crosshair
  marks = [];
  enlarged = new Set();
  contents = new Map();
  pictures = [];
  shown = []; // the pictures, or those shown in their place
  width = 0; // px of a picture on the screen
  pointers = new Map(); // those that are down, by number

  constructor(parent) {
    super(parent);
    this.surface = surface;
    const on = (kind, react) => this.listen(eventOf(kind), ({ detail }) => detail.name === this.name && react(detail));
    on("marks", ({ item }) => this.set({ marks: item.marks }));
    on("description", () => this.describe());
    on("preview", (item) => this.preview(item));
    this.listen(eventOf("pictures"), ({ detail }) => {
      this.renew(detail);
      this.describe();
    });
    this.atEnd(() => this.contents.forEach(forget));
  }

  load(name) {
    this.name = name;
    this.describe();
  }

  // Shows the pictures of the latest description as soon as all have arrived.
  async describe() {
    const data = received("description", this.name);
    if (!data || data === this.data) return;
    if (!data.pictures.every(({ digest }) => this.contents.has(digest) || received("pictures", digest))) return;
    const contents = data.pictures.map(({ digest }) => this.content(digest));
    await Promise.all(contents.map((one) => one.ready));
    if (data !== received("description", this.name)) return; // a newer set overtook this one
    const sameScene = this.data?.rows === data.rows && this.data?.cols === data.cols;
    this.data = data;
    this.pictures = data.pictures.map((one, index) => picture(one, contents[index], data.colours));
    this.shown = [...this.pictures];
    const shown = new Set(data.pictures.map(({ digest }) => digest));
    for (const [digest, one] of this.contents) {
      if (shown.has(digest)) continue;
      this.contents.delete(digest);
      forget(one);
    }
    if (!sameScene) Object.assign(this, { zoom: 1, x: 0, y: 0, at: null });
    const titles = this.pictures.map(({ title }) => title);
    if (!this.pair.every((title) => titles.includes(title))) this.pair = [titles[0], titles[Math.min(1, titles.length - 1)]];
    this.set({ marks: data.marks });
  }

  // The picture that arrived under a digest, unpacked once.
  content(digest) {
    if (!this.contents.has(digest)) this.contents.set(digest, contentOf(received("pictures", digest)));
    return this.contents.get(digest);
  }

  // Shows a map that replaces another at once; its description follows with the next `load`.
  renew({ name: digest, before, item }) {
    const index = this.pictures.findIndex((one) => one.digest === before && !one.image);
    if (index < 0 || !item || this.content(digest).image) return;
    this.pictures[index] = picture({ ...this.pictures[index], digest }, this.content(digest), this.data.colours);
    this.shown[index] = { ...this.pictures[index], figures: this.shown[index].figures };
    this.draw();
  }

  // Shows a map in place of the picture with its title until that is renewed, and its figures if it has any; without
  // parts, shows the picture again.
  preview(item) {
    const index = this.pictures.findIndex((one) => one.title === item.title);
    const one = this.pictures[index];
    if (!one) return;
    const content = item.parts.length && (this.contents.get(item.digest) ?? contentOf(item));
    if (item.whole) this.contents.set(item.digest, content); // its description is on its way
    const shown = content ? picture({ ...one, digest: item.digest }, content, one.colours) : one;
    if (item.live) this.pictures[index] = shown; // its values are read under the pointer
    this.shown[index] = { ...shown, figures: item.figures ?? one.figures };
    this.draw();
  }

  // The pictures shown large, each alone or two on top of each other.
  get cells() {
    if (this.mode === "grid") return this.shown.filter((one) => this.isLarge(one)).map((one) => [one]);
    return [this.pair.map((title) => this.shown.find((one) => one.title === title))];
  }

  isLarge(one) {
    return !one.thumbnail || this.enlarged.has(one.title);
  }

  // Adds a small picture to the large ones, or removes it.
  enlarge({ title }) {
    if (!this.enlarged.delete(title)) this.enlarged.add(title);
    this.draw();
  }

  get isPickable() {
    return this.pictures.some((one) => one.pickable);
  }

  get hint() {
    return [this.data.hint, `${HINT}${this.isPickable ? ", Enter picks." : "."}`].filter(Boolean).join(" ");
  }

  // The pixel whose values are shown: that of the crosshair, or else the point marked last.
  get read() {
    return this.at ?? this.marks.findLast((mark) => !mark.height && !mark.to) ?? null;
  }

  textsOf({ title }) {
    return this.read ? textsAt(this.pictures.find((one) => one.title === title), this.read, this.data.step) : [];
  }

  get viewBox() {
    return `${this.x} ${this.y} ${this.data.cols / this.zoom} ${this.data.rows / this.zoom}`;
  }

  marksOn({ title }) {
    const index = this.pictures.findIndex((one) => one.title === title);
    const pixel = this.data.cols / this.zoom / (this.width || 1);
    const here = this.marks.filter(({ pictures }) => !pictures.length || pictures.includes(index));
    return here.map((mark) => shapeOf(mark, pixel));
  }

  draw() {
    if (!this.data) return;
    const { rows, cols, name } = this.data;
    // Announces the position of the crosshair: {row, col}, or null without one.
    if (this.at !== this.told) tell("crosshair", { name, at: (this.told = this.at) });
    this.x = clamp(this.x, 0, cols - cols / this.zoom);
    this.y = clamp(this.y, 0, rows - rows / this.zoom);
    this.render();
    this.findAll("canvas").forEach(paint);
    const before = this.width;
    this.width = this.find(".viewport")?.clientWidth ?? 0;
    if (this.width !== before) this.render();
  }

  // Zooms about a place, which stays fixed: by default the crosshair, or else the middle. A factor of 0 shows the whole
  // picture.
  zoomBy(factor, place) {
    const { rows, cols } = this.data;
    const zoom = clamp(this.zoom * factor, 1, Math.max(1, cols / CLOSEST_PX));
    const x = place?.x ?? this.at?.col ?? this.x + cols / this.zoom / 2;
    const y = place?.y ?? this.at?.row ?? this.y + rows / this.zoom / 2;
    this.x = x - ((x - this.x) * this.zoom) / zoom;
    this.y = y - ((y - this.y) * this.zoom) / zoom;
    this.zoom = zoom;
    this.draw();
  }

  // Input: pointer, wheel and keys.

  // The viewport under the pointer, or the one in which it went down.
  cellOf({ target }) {
    return target.closest(".viewport");
  }

  // The pixel under the pointer, the pointer's place in the picture, px, and how far it is across the view, 0..1.
  place(event, cell) {
    const [u, v] = shareOf(event, cell).map((share) => clamp(share, 0, 1));
    const { rows, cols } = this.data;
    const [x, y] = [this.x + (u * cols) / this.zoom, this.y + (v * rows) / this.zoom];
    return { row: clamp(Math.floor(y), 0, rows - 1), col: clamp(Math.floor(x), 0, cols - 1), x, y, u };
  }

  press(event) {
    const cell = this.cellOf(event);
    if (!cell || event.button) return;
    this.pointers.set(event.pointerId, event);
    const { u } = this.place(event, cell);
    const onSplit = this.mode === "slider" && Math.abs(u - this.split / 100) * this.width < 16;
    this.held = { cell, moved: false, released: null, onSplit };
    if (event.pointerType === "mouse" || this.zoom > 1) cell.setPointerCapture(event.pointerId);
  }

  move(event) {
    const cell = this.cellOf(event);
    const last = this.pointers.get(event.pointerId);
    if (last && this.held) this.drag(event, last);
    this.set({ at: cell ? this.place(event, cell) : null });
  }

  drag(event, last) {
    const [dx, dy] = [event.clientX - last.clientX, event.clientY - last.clientY];
    if (!this.held.moved && Math.hypot(dx, dy) < DRAG_PX) return;
    this.held.moved = true;
    const place = this.place(event, this.held.cell);
    if (this.held.onSplit) this.split = clamp(place.u * 100, 0, 100);
    else if (this.pointers.size === 2) {
      const other = [...this.pointers.values()].find((one) => one.pointerId !== event.pointerId);
      const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
      this.zoomBy(apart(event) / Math.max(1, apart(last)), place);
    } else {
      const pixel = this.data.cols / this.zoom / this.width;
      this.x -= dx * pixel;
      this.y -= dy * pixel;
    }
    this.dragging = this.zoom > 1;
    this.pointers.set(event.pointerId, event);
  }

  // A click after a drag picks nothing, nor does the second click of a double click, which resets the zoom.
  click(event) {
    const { moved, released } = this.held ?? { moved: false, released: null };
    this.held = null;
    if (!released || moved || event.detail > 1) return;
    if (this.cells[this.findAll(".viewport").indexOf(this.cellOf(event))]?.[0].pickable) this.pick(released);
  }

  pick({ row, col }) {
    this.trigger("picked", { row, col });
  }

  release(event) {
    this.pointers.delete(event.pointerId);
    const cell = this.cellOf(event);
    if (cell && this.held) this.held.released = this.place(event, cell); // a click has its position in whole px only
    this.dragging = false;
    this.draw();
  }

  roll(event) {
    const cell = this.cellOf(event);
    // The wheel is left to the page unless the pictures have been clicked on, and when zooming out from whole pictures.
    const meant = event.ctrlKey || event.metaKey || this.stage.getRootNode().activeElement === this.stage;
    if (!cell || !meant || (event.deltaY > 0 && this.zoom === 1 && !event.ctrlKey)) return;
    event.preventDefault();
    this.zoomBy(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.002)), this.place(event, cell));
  }

  actions(event) {
    const { at } = this;
    const pick = at && this.isPickable ? () => this.pick(at) : undefined;
    const zoom = event.key in ZOOMS && (() => this.zoomBy(ZOOMS[event.key]));
    return { [event.key]: zoom, ...arrows(event, (down, right) => this.step(down, right)), Enter: pick, " ": pick };
  }

  // Moves the crosshair, and the zoomed view so that it stays inside.
  step(down, right) {
    const { rows, cols } = this.data;
    const from = this.read ?? { row: rows >> 1, col: cols >> 1 };
    const [row, col] = [clamp(from.row + down, 0, rows - 1), clamp(from.col + right, 0, cols - 1)];
    this.x = clamp(this.x, col + 1 - cols / this.zoom, col);
    this.y = clamp(this.y, row + 1 - rows / this.zoom, row);
    this.set({ at: { row, col } });
  }
}
