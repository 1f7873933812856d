// A template dragged over a picture, without server requests.

import { colourAt, cut, line, put, placeIn } from "../shared/dom.js";
import { eventOf } from "../shared/exchange.js";
import { clamp, filled, shortened, total } from "../shared/numbers.js";
import { pixelsOf, scoresOf, unpacked } from "../shared/packing.js";
import { arrows, Panel, show } from "../shared/panel.js";

const SPOT = 3; // places on every side of a visited one that are painted with it

export default (component) => show(TemplatePanel, component, view);

class TemplatePanel extends Panel {
  setUp() {
    this.listen(eventOf("place"), ({ detail }) => detail.name === this.data.name && this.compare(detail));
  }

  async load(data) {
    const turn = (this.turn = {});
    const search = await searched(data);
    const same = search.digest === this.data?.digest; // the page ran again: the painting stays
    if (turn !== this.turn || this.gone.signal.aborted || same) return;
    this.data = search;
    const { picture, template, map } = search;
    this.widest = `calc(${picture.cols / picture.rows} * max(20rem, 100vh - 28rem))`; // on the first screen
    this.row = Math.round((map.rows - 1) * 0.2);
    this.col = Math.round((map.cols - 1) * 0.2);
    this.clear();
    this.render();
    put(this.find(".picture"), picture);
    for (const name of [".held canvas", ".template canvas"]) put(this.find(name), template);
  }

  clear() {
    const { rows, cols } = this.data.map;
    this.painted = { rows, cols, data: new Uint8ClampedArray(4 * rows * cols) };
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
    const { rows, cols } = this.data.map;
    for (let down = Math.max(0, row - SPOT); down <= Math.min(rows - 1, row + SPOT); down++) {
      for (let right = Math.max(0, col - SPOT); right <= Math.min(cols - 1, col + SPOT); right++) this.fill(down * cols + right);
    }
  }

  fill(at) {
    const { data } = this.painted;
    if (data[4 * at + 3]) return;
    data.set(colourOf(this.data.map.scores[at], this.data.words.palette), 4 * at);
    data[4 * at + 3] = 255;
  }

  reveal() {
    this.data.map.scores.forEach((_, at) => this.fill(at));
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
    const { picture, template, map, leaders, words } = this.data;
    cut(this.find(".window canvas"), picture.image, this.col, this.row, template.cols, template.rows);
    put(this.find(".products canvas"), inProductColours(template, compared(picture, template, this.row, this.col)));
    put(this.find(".map canvas"), this.painted);
    const reach = clamp(Math.round(0.6 * Math.max(template.rows, template.cols)), 8, 20);
    this.findAll(".leaders canvas").forEach((canvas, at) => drawRelief(canvas, map, leaders[at], reach, words.palette));
  }

  lesson() {
    const { leaders: [peak, rival], words } = this.data;
    if (!peak) return words.nothing;
    const told = filled(words.peak, { ...this.inImage(peak), score: shortened(peak.score, 3) });
    return told + (rival ? filled(words.lead, { rival: shortened(rival.score, 3) }) : "");
  }

  rings() {
    const { map, leaders } = this.data;
    const r = Math.max(7, map.cols / 50);
    const found = leaders.map(({ row, col }, at) => ({ kind: at ? "rival" : "peak", row, col, r }));
    return [...(this.revealed ? found : []), { kind: "now", row: this.row, col: this.col, r: r / 2 }];
  }
}

// Unpacks the data of stereolag.ui.components.packed_search.
async function searched(data) {
  const { parts, ...header } = unpacked(data);
  const [picture, template, opaque, codes] = await Promise.all(parts.map(pixelsOf));
  const counts = Uint8Array.from({ length: opaque.rows * opaque.cols }, (_, at) => opaque.data[4 * at]);
  counts.forEach((value, at) => (template.data[4 * at + 3] = value));
  const sought = { ...prepared(template, counts), data: template.data };
  return { ...header, picture, template: sought, map: scoresOf(codes, header.steps) };
}

// The products at one place of the template. Their mean is the score: Pearson's correlation over all channels.

const CHANNELS = 3;

// The template's deviations from the mean of each channel, over the pixels that count; `data` are RGBA bytes.
export function prepared({ data, rows, cols }, counts) {
  const places = [...counts.keys()].filter((at) => counts[at]);
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

// The drawings: enlarged pieces, the products of their pixels, the score map, and the relief around a peak.

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

// The colour of a score: the darkest at 0 and below, the brightest at 1, grey where there is no score.
const colourOf = (score, palette) => (Number.isNaN(score) ? [140, 140, 140] : colourAt(score, palette));

// The scores around a place, seen from the front and above, far rows first; equal heights always mean equal scores.
function drawRelief(canvas, map, place, reach, palette) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const key = [map, place, width, height, ratio];
  if (key.every((one, at) => one === canvas.drawn?.[at])) return;
  canvas.drawn = key;
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  const side = 2 * reach + 1;
  const depth = height * 0.42;
  const rise = height * 0.54;
  const score = (down, right) => {
    const [row, col] = [place.row + down, place.col + right];
    const inside = row >= 0 && col >= 0 && row < map.rows && col < map.cols;
    const found = inside ? map.scores[row * map.cols + col] : NaN;
    return Number.isNaN(found) ? 0 : found;
  };
  const at = (down, right) => {
    const near = (down + reach) / side; // 0 far … 1 near
    const x = width / 2 + (right / side) * width * (0.72 + 0.26 * near);
    return [x, height - depth * (1 - near) - 4 - Math.max(0, score(down, right)) * rise];
  };
  for (let down = -reach; down < reach; down++) {
    for (let right = -reach; right < reach; right++) {
      const corners = [at(down, right), at(down, right + 1), at(down + 1, right + 1), at(down + 1, right)];
      const heights = [score(down, right), score(down, right + 1), score(down + 1, right + 1), score(down + 1, right)];
      const mean = total(heights) / 4;
      const light = 1 + 1.2 * clamp(heights[1] - heights[0], -0.3, 0.3); // lit from the left
      context.fillStyle = `rgb(${colourOf(mean, palette).map((value) => Math.min(255, Math.round(value * light)))})`;
      context.strokeStyle = context.fillStyle;
      context.lineWidth = 0.7;
      const outline = new Path2D(`${line(corners)}Z`);
      context.fill(outline);
      context.stroke(outline);
    }
  }
}
