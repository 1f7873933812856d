// A template dragged over a picture, without server requests.

import { cut, put, placeIn } from "../shared/dom.js";
import { eventOf } from "../shared/exchange.js";
import { clamp, shortened, total } from "../shared/numbers.js";
import { pixelsOf, scoresOf, unpacked } from "../shared/packing.js";
import { arrows, Panel } from "../shared/panel.js";

const SPOT = 3; // places on each side of a visited one that are painted with it

export default class TemplatePanel extends Panel {
  setUp() {
    this.listen(eventOf("place"), ({ detail }) => detail.name === this.data.name && this.compare(detail));
  }

  async load(data) {
    const turn = (this.turn = {});
    const search = await searched(data);
    const same = search.digest === this.data?.digest; // the page was rerun: the painting stays
    if (turn !== this.turn || this.gone.signal.aborted || same) return;
    this.data = search;
    const { picture, template, map } = search;
    this.widest = `calc(${picture.cols / picture.rows} * max(20rem, 100vh - 28rem))`; // fits on the screen without scrolling
    this.row = Math.round((map.rows - 1) * 0.2);
    this.col = Math.round((map.cols - 1) * 0.2);
    this.revealed = false;
    this.render();
    this.painting = this.find(".map canvas").getContext("2d");
    this.clear();
    put(this.find(".picture"), picture);
    for (const name of [".held canvas", ".template canvas"]) put(this.find(name), template);
  }

  clear() {
    const { cols: width, rows: height } = this.data.map;
    Object.assign(this.painting.canvas, { width, height }); // which empties it
    this.revealed = false;
    this.paint(this.row, this.col);
    this.schedule();
  }

  // Moves the template and paints every place on the way; `jump` skips the places between.
  move(row, col, { jump = false } = {}) {
    const { rows, cols } = this.data.map;
    const to = { row: clamp(Math.round(row), 0, rows - 1), col: clamp(Math.round(col), 0, cols - 1) };
    const [down, right] = [to.row - this.row, to.col - this.col];
    const steps = jump ? 1 : Math.max(1, Math.abs(down), Math.abs(right));
    for (let step = 1; step <= steps; step++) {
      this.paint(Math.round(this.row + (down * step) / steps), Math.round(this.col + (right * step) / steps));
    }
    Object.assign(this, to);
    this.schedule();
  }

  paint(row, col) {
    const place = [col - SPOT, row - SPOT, 2 * SPOT + 1, 2 * SPOT + 1];
    this.painting.drawImage(this.data.map.image, ...place, ...place);
  }

  reveal() {
    this.painting.drawImage(this.data.map.image, 0, 0);
    this.revealed = true;
    this.schedule();
  }

  actions(event) {
    return arrows(event, (down, right) => this.move(this.row + down, this.col + right));
  }

  grab(event) {
    const touched = event.pointerType === "touch"; // outside the template a finger scrolls the page or taps
    if (touched && !this.find(".held").contains(event.target)) return null;
    if (!touched) this.jump(event);
    const [fromRow, fromCol] = this.placeOf(event);
    const [down, right] = [fromRow - this.row, fromCol - this.col];
    const move = (moved) => {
      const [row, col] = this.placeOf(moved);
      this.move(row - down, col - right);
    };
    return { move };
  }

  // Brings the template under the pointer, unless it is already there.
  jump(event) {
    if (this.find(".held").contains(event.target)) return;
    const [row, col] = this.placeOf(event);
    const { rows, cols } = this.data.template;
    this.move(row - rows / 2, col - cols / 2, { jump: true });
  }

  placeOf(event) {
    return placeIn(event, this.stage, this.data.picture);
  }

  // A place in the whole image, px.
  inImage({ row, col }) {
    const { factor, row: top, col: left } = this.data;
    return { row: top + row * factor, col: left + col * factor };
  }

  // Compares at a place of the whole image, px.
  compare({ row, col }) {
    const { factor, row: top, col: left } = this.data;
    this.move((row - top) / factor, (col - left) / factor, { jump: true });
    this.find(".pieces").scrollIntoView({ block: "nearest" });
  }

  get score() {
    const { scores, cols } = this.data.map;
    return shortened(scores[this.row * cols + this.col], 3);
  }

  draw() {
    this.render();
    const { picture, template } = this.data;
    cut(this.find(".window canvas"), picture.image, this.col, this.row, template.cols, template.rows);
    put(this.find(".products canvas"), inProductColours(template, compared(picture, template, this.row, this.col)));
  }
}

// Unpacks the data of stereolag.ui.components.packed_search.
async function searched(data) {
  const { parts, ...header } = unpacked(data);
  const [picture, template, codes, shown] = await Promise.all(parts.map(pixelsOf));
  const sought = { ...prepared(template), data: template.data };
  return { ...header, picture, template: sought, map: { ...scoresOf(codes, header.steps), image: shown.image } };
}

// The products at one place of the template. Their mean is the score: Pearson's correlation over all channels.

const CHANNELS = 3;

// The template's deviations from the mean of each channel, over the opaque pixels, which are those that count.
export function prepared({ data, rows, cols }) {
  const places = Array.from({ length: rows * cols }, (_, at) => at).filter((at) => data[4 * at + 3]);
  const deviations = centred(places.map((at) => 4 * at), data);
  return { rows, cols, places, deviations, norm: lengthOf(deviations) };
}

const lengthOf = (vector) => Math.sqrt(total(vector.map((value) => value * value)));

// RGB of some pixels minus the mean of each channel. Values relative to the first pixel make a flat window exactly 0.
function centred(starts, data) {
  const values = new Float64Array(CHANNELS * starts.length);
  for (let channel = 0; channel < CHANNELS; channel++) {
    const first = data[starts[0] + channel];
    const mean = total(starts.map((start) => data[start + channel] - first)) / starts.length;
    starts.forEach((start, index) => (values[CHANNELS * index + channel] = data[start + channel] - first - mean));
  }
  return values;
}

// The products of the pixels that count with the template's top-left pixel at (row, col), 0 on a flat window.
export function compared(picture, template, row, col) {
  const { places, deviations, norm, cols } = template;
  const starts = places.map((at) => 4 * ((row + Math.floor(at / cols)) * picture.cols + col + (at % cols)));
  const window = centred(starts, picture.data);
  const scale = places.length / (norm * lengthOf(window) || Infinity);
  const products = new Float64Array(places.length);
  window.forEach((value, at) => (products[Math.floor(at / CHANNELS)] += value * deviations[at] * scale));
  return products;
}

const WARM = [224, 104, 56];
const COOL = [58, 130, 190];
const STRONG = 3; // times the mean product of a perfect match

// Warm where a pixel agrees, cool where it disagrees, stronger with the product; pixels that do not count stay clear.
function inProductColours({ rows, cols, places }, products) {
  const data = new Uint8ClampedArray(4 * rows * cols);
  places.forEach((at, index) => {
    data.set(products[index] > 0 ? WARM : COOL, 4 * at);
    data[4 * at + 3] = 30 + 225 * Math.min(1, Math.sqrt(Math.abs(products[index]) / STRONG));
  });
  return { rows, cols, data };
}
