// Pictures of one scene with a common crosshair: zoomed and moved together, read under the cursor, clickable.
// Rows and columns are those of the whole picture, whatever share of its pixels was sent.

const CLOSEST_PX = 12;
const HINT =
  "Drag to move, double-click for the whole image; click first, and the wheel zooms. Arrow keys move the crosshair";

class LinkedPictures {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.root = this.find(".linked");
    this.stage = this.find(".stage");
    this.mode = "grid";
    this.pair = null;
    this.split = 50;
    this.zoom = 1;
    this.x = this.y = 0;
    this.at = null;
    this.marks = [];
    this.enlarged = new Set();
    this.contents = new Map();
    this.onMarks = ({ detail }) => detail.name === this.header?.name && this.setMarks(detail.marks);
    this.onPicture = ({ detail }) => {
      this.renew(detail);
      this.load(this.data);
    };
    this.onOutlines = ({ detail }) => detail === this.header?.name && this.draw();
    window.addEventListener("stereolag-marks", this.onMarks);
    window.addEventListener("stereolag-outlines", this.onOutlines);
    window.addEventListener("stereolag-picture", this.onPicture);
    this.resized = new ResizeObserver(() => this.draw());
    this.resized.observe(this.stage);
  }

  close() {
    window.removeEventListener("stereolag-marks", this.onMarks);
    window.removeEventListener("stereolag-outlines", this.onOutlines);
    window.removeEventListener("stereolag-picture", this.onPicture);
    this.resized.disconnect();
    this.contents.forEach(forget);
  }

  // Shows the pictures that `data` describes as soon as all have arrived.
  async load(data) {
    this.data = data;
    if (!data || data === this.header) return;
    const arrived = window.stereolagPictures ?? new Map();
    if (!data.pictures.every(({ digest }) => this.contents.has(digest) || arrived.has(digest))) return;
    const contents = data.pictures.map(({ digest }) => this.content(digest));
    await Promise.all(contents.map((one) => one.ready));
    if (data !== this.data) return; // a newer set overtook this one
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
    this.marks = window.stereolagMarks?.get(data.name) ?? [];
    this.build();
  }

  // The picture that arrived under a digest, unpacked once.
  content(digest) {
    if (!this.contents.has(digest)) this.contents.set(digest, unpacked(window.stereolagPictures.get(digest).data));
    return this.contents.get(digest);
  }

  // Shows a map that replaces another at once; its description follows with the next `load`.
  renew({ digest, before }) {
    const index = this.pictures?.findIndex((one) => one.digest === before && !one.image) ?? -1;
    if (index < 0 || this.content(digest).image) return;
    this.pictures[index] = picture({ ...this.pictures[index], digest }, this.content(digest), this.header.colours);
    this.show(index);
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
    [".before", ".after"].forEach((name, side) => {
      const select = this.find(name);
      select.replaceChildren(...titles.map((title) => new Option(title, title)));
      select.value = this.pair[side];
    });
    this.root.classList.toggle("slider", this.mode === "slider");
    this.find(".modes").hidden = titles.length < 2;
    for (const button of this.root.querySelectorAll("[data-mode]")) {
      button.setAttribute("aria-pressed", button.dataset.mode === this.mode);
    }
    this.stage.style.setProperty("--columns", this.header.columns);
    const large = [...this.pictures.keys()].filter((index) => this.isLarge(this.pictures[index]));
    this.cells = this.mode === "slider" ? [this.cell(before, after)] : large.map((index) => this.cell(index));
    this.stage.replaceChildren(...this.cells.map((cell) => cell.figure));
    this.thumbnails = [...this.pictures.keys()].filter((index) => this.pictures[index].thumbnail);
    this.find(".thumbnails").replaceChildren(...this.thumbnails.map((index) => this.thumbnail(this.pictures[index])));
  }

  // Updates the pictures and their figures in the present layout.
  refresh() {
    this.pictures.forEach((_, index) => this.show(index));
    for (const { indices, figures: below } of this.cells) {
      below?.replaceChildren(...figures(this.pictures[indices[0]].figures));
    }
    this.draw();
  }

  // Updates one picture wherever it is shown.
  show(index) {
    for (const { indices, layers } of this.cells) {
      layers.forEach((layer, side) => indices[side] === index && fill(layer.firstChild, this.pictures[index]));
    }
    const small = this.find(".thumbnails").children[this.thumbnails.indexOf(index)];
    if (small) fill(small.firstChild, this.pictures[index]);
  }

  cell(...indices) {
    const layers = indices.map((index) => element("div", "layer", surface(this.pictures[index])));
    const viewport = element("div", "viewport", ...layers);
    viewport.style.aspectRatio = `${this.header.cols} / ${this.header.rows}`;
    const svg = drawn("svg", { preserveAspectRatio: "none", "aria-hidden": true }, viewport);
    const readings = indices.map(() => element("p", "reading"));
    const caption = element("figcaption", "", ...indices.map((index) => element("span", "", this.pictures[index].title)));
    const below = indices.length > 1 || !this.pictures[indices[0]].figures.length ? null : element("dl", "figures");
    const figure = element("figure", "", caption, viewport, element("div", "readings", ...readings), ...(below ? [below] : []));
    const cell = { indices, figure, viewport, svg, layers, readings, figures: below };
    if (indices.length > 1) this.addSplit(cell);
    return cell;
  }

  isLarge(one) {
    return !one.thumbnail || this.enlarged.has(one.title);
  }

  // A small picture; a click adds it to the large ones or removes it from them.
  thumbnail(one) {
    const title = element("span", "", one.title);
    title.setAttribute("aria-hidden", true); // the picture has the same label
    const button = element("button", "", surface(one), title);
    const large = this.isLarge(one);
    Object.assign(button, { type: "button", title: large ? "Make it small again" : "Enlarge" });
    button.setAttribute("aria-pressed", large);
    button.addEventListener("click", () => {
      if (!this.enlarged.delete(one.title)) this.enlarged.add(one.title);
      const place = [...button.parentElement.children].indexOf(button);
      this.build();
      this.find(".thumbnails").children[place]?.focus({ preventScroll: true }); // the button was replaced
    });
    return button;
  }

  addSplit(cell) {
    const edge = element("div", "edge");
    const slider = element("input", "split");
    Object.assign(slider, { type: "range", min: 0, max: 100, step: 0.1, value: this.split });
    slider.setAttribute("aria-label", "How much of the image on the left is seen");
    const move = (share) => {
      this.split = slider.value = clamp(share, 0, 100);
      edge.style.left = `${this.split}%`;
      cell.layers[1].style.clipPath = `inset(0 0 0 ${this.split}%)`;
    };
    slider.addEventListener("input", () => move(Number(slider.value)));
    cell.moveSplit = move;
    cell.viewport.append(edge);
    cell.viewport.after(slider);
    move(this.split);
  }

  draw() {
    if (!this.cells) return;
    if (this.at !== this.told) this.tell((this.told = this.at));
    const { rows, cols } = this.header;
    this.zoom = clamp(this.zoom, 1, Math.max(1, cols / CLOSEST_PX));
    this.x = clamp(this.x, 0, cols - cols / this.zoom);
    this.y = clamp(this.y, 0, rows - rows / this.zoom);
    this.root.classList.toggle("zoomed", this.zoom > 1);
    this.find("[data-zoom=reset]").textContent = `${this.zoom < 9.95 ? +this.zoom.toFixed(1) : Math.round(this.zoom)}×`;
    const points = this.marks.filter((mark) => !mark.height && !mark.to);
    const view = `${this.x} ${this.y} ${cols / this.zoom} ${rows / this.zoom}`;
    const outlines = window.stereolagOutlines?.get(this.header.name);
    const read = this.at ?? points.at(-1) ?? null;
    this.find(".where").textContent = read ? `row ${read.row}, column ${read.col}` : "";
    for (const cell of this.cells) {
      const width = cell.viewport.clientWidth;
      cell.viewport.classList.toggle("near", (width * this.zoom) / cols > 3);
      cell.layers.forEach((layer, side) => {
        layer.firstChild.style.transform =
          `scale(${this.zoom}) translate(${(-this.x / cols) * 100}%, ${(-this.y / rows) * 100}%)`;
        outline(layer, this.pictures[cell.indices[side]].image ? "" : outlines, view);
      });
      cell.svg.setAttribute("viewBox", view);
      cell.svg.replaceChildren();
      const pixel = cols / this.zoom / (width || 1);
      for (const mark of this.marks) {
        if (!mark.pictures.length || mark.pictures.includes(cell.indices[0])) drawMark(mark, pixel, cell.svg);
      }
      if (this.at) this.drawCross(cell.svg);
      cell.indices.forEach((index, side) => {
        cell.readings[side].replaceChildren(...(read ? this.readAt(this.pictures[index], read) : []));
      });
    }
  }

  // Announces the position of the crosshair: {row, col}, or null without one.
  tell(at) {
    window.dispatchEvent(new CustomEvent("stereolag-crosshair", { detail: { name: this.header.name, at } }));
  }

  drawCross(svg) {
    const { rows, cols } = this.header;
    const [x, y] = [this.at.col + 0.5, this.at.row + 0.5];
    for (const name of ["cross-halo", "cross"]) drawn("path", { class: name, d: `M0 ${y}H${cols}M${x} 0V${rows}` }, svg);
  }

  readAt(picture, { row, col }) {
    const step = this.header.step;
    const parts = [];
    for (const reading of picture.readings) {
      const value = reading.values()[Math.floor(row / step) * reading.cols + Math.floor(col / step)];
      if (reading.words.length) parts.push(reading.words[value]);
      else if (value !== NOTHING) parts.push(...numbers(value * reading.quantum, reading));
    }
    return parts.filter(Boolean).flatMap((part, index) => {
      const text = element("span", index ? "faint" : "", part);
      return index ? [" · ", text] : [text];
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

