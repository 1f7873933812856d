// Pictures, marks, outlines, and the text of readings.

import { element, node, put } from "../shared/dom.js";
import { unzlibSync } from "../shared/fflate.js";
import { clamp, shortened } from "../shared/numbers.js";

const LOADING_MS = 10_000;

// A picture with its content, and a text that tells whether a surface shows it already.
export function picture(described, { image, readings }, colours) {
  const read = readings.map((reading, index) => ({ ...reading, depth: described.depths[index] }));
  const seen = image ? described.digest : [described.digest, colours.low, colours.high, colours.palette].join();
  return { ...described, image, readings: read, colours, seen };
}

// The element that shows a picture; each place it is shown at needs its own.
export function surface(one) {
  const made = element(one.image ? "img" : "canvas");
  if (one.image) made.draggable = false;
  else made.setAttribute("role", "img");
  fill(made, one);
  return made;
}

// Draws a picture on a surface, unless the surface already shows it in the same colours.
export function fill(made, { title, alternative, image, readings, colours, seen }) {
  made.setAttribute(image ? "alt" : "aria-label", alternative ? `${title}: ${alternative}` : title);
  if (made.seen === seen) return;
  made.seen = seen;
  if (image) made.src = image.src;
  else paint(made, readings[0], colours);
}

// An element that has just been given the picture may still be loading it.
export function forget({ image }) {
  if (image) setTimeout(() => URL.revokeObjectURL(image.src), LOADING_MS);
}

export function figures(all) {
  return all.map(({ label, value, meaning }) => {
    const one = element("div", "", element("dt", "", label), element("dd", "", value));
    one.title = meaning;
    return one;
  });
}

// The texts of a picture's readings at a pixel; `step` pixels of the picture share a value.
export function textsAt({ readings }, { row, col }, step) {
  return readings.flatMap((reading) => {
    const value = reading.values()[Math.floor(row / step) * reading.cols + Math.floor(col / step)];
    if (reading.words.length) return [reading.words[value]];
    return value === NOTHING ? [] : numbers(value * reading.quantum, reading);
  }).filter(Boolean);
}

function numbers(value, { label, unit, digits, depth }) {
  const texts = [[label, shortened(value, digits, unit)].filter(Boolean).join(" ")];
  if (depth && value + depth.doffs_px > 0) {
    const metres = depth.focal_times_baseline / (value + depth.doffs_px);
    const error = (metres ** 2 * depth.disparity_error) / depth.focal_times_baseline;
    texts.push(error ? `${metric(metres, error)} ±\u00a0${metric(error, error, "m")}` : metric(metres, metres / 100, "m"));
  }
  return texts;
}

// As many decimals as the error leaves certain, and one more.
function metric(metres, error, unit = "") {
  return shortened(metres, clamp(1 - Math.floor(Math.log10(error)), 0, 4), unit);
}

// Draws a mark: a point, a frame, or a line to another point; `pixel` is the size of a pixel of the screen.
export function drawMark(add, mark, pixel) {
  const x = mark.height ? mark.col : mark.col + 0.5;
  const y = mark.height ? mark.row : mark.row + 0.5;
  let d = `M${x} ${y}h0`;
  let [width, halo] = [9, 13];
  if (mark.height) [d, width, halo] = [`M${x} ${y}h${mark.width}v${mark.height}h${-mark.width}z`, 2, 4];
  if (mark.to) [d, width, halo] = [`M${x} ${y}L${mark.to[1] + 0.5} ${mark.to[0] + 0.5}`, 2, 4];
  const dash = mark.dashed ? { "stroke-dasharray": "6 4" } : {};
  add("path", { d, class: "halo", "stroke-width": halo, "stroke-linecap": "round" });
  if (mark.filled) add("path", { d, style: `fill: ${mark.colour}`, "fill-opacity": 0.22 });
  add("path", { d, stroke: mark.colour, "stroke-width": width, "stroke-linecap": mark.dashed ? "butt" : "round", ...dash });
  if (!mark.label) return;
  const [dx, dy] = mark.height ? [0, -5] : [9, -7];
  add("text", { x: x + dx * pixel, y: y + dy * pixel, "font-size": 13 * pixel }, mark.label);
}

// Outlines over a layer, px of the picture: lines that are thin at every zoom, light on dark, so that they are visible on
// every colour. Their SVG is a separate one, so that a moving crosshair does not redraw them; without a path it goes.
export function drawOutlines(layer, path, view) {
  let svg = layer.querySelector(".outlines");
  if (!path) return svg?.remove();
  if (!svg) layer.append((svg = node("svg", { class: "outlines", preserveAspectRatio: "none", "aria-hidden": true })));
  if (svg.path !== path) {
    svg.path = path;
    svg.replaceChildren(...["outline-halo", "outline"].map((name) => node("path", { class: name, d: path })));
  }
  if (svg.view !== view) svg.setAttribute("viewBox", (svg.view = view));
}

// Unpacks the item of a picture into its pixels and readings, and colours maps.

const NOTHING = -32768;
const LONG = 128;

// The reverse of stereolag.ui.linked_pictures.packed. Everything but photographs is unpacked synchronously: an
// awaited result would come only after all other work that a change causes on the page.
export function contentOf({ parts, image, type, readings }) {
  const pixels = image === null ? null : pictured(parts[image], type);
  return { image: pixels, ready: pixels?.decode(), readings: readings.map((one) => readable(one, parts)) };
}

function pictured(bytes, type) {
  const image = new Image();
  image.src = URL.createObjectURL(new Blob([bytes], { type }));
  return image;
}

// A reading whose values are unpacked on first use: many are needed only under the pointer.
function readable(described, parts) {
  let values;
  return { ...described, values: () => (values ??= inflated(described, parts)) };
}

// Values from their steps along each row; the Int16Array wraps around as the steps did.
function inflated({ rows, cols, steps, long_steps }, parts) {
  const short = unzlibSync(parts[steps], { out: new Uint8Array(rows * cols) });
  const long = new Int16Array(unzlibSync(parts[long_steps]).slice().buffer);
  const values = new Int16Array(rows * cols);
  for (let start = 0, next = 0; start < values.length; start += cols) {
    for (let at = start, value = 0; at < start + cols; at++) {
      const step = short[at];
      value += step === LONG ? long[next++] : (step << 24) >> 24;
      values[at] = value;
    }
  }
  return values;
}

// Draws a map on a canvas in the colours shared by all maps.
function paint(canvas, reading, colours) {
  const [values, table] = [reading.values(), colourTable(colours, reading.quantum)];
  const pixels = new Uint32Array(values.length);
  for (let at = 0; at < values.length; at++) pixels[at] = table[values[at] - NOTHING];
  put(canvas, { data: new Uint8ClampedArray(pixels.buffer), rows: reading.rows, cols: reading.cols });
}

let lastTable = { key: "", table: null };

// The pixel of every int16, kept as long as the colours do not change.
function colourTable({ low, high, palette, none }, quantum) {
  const key = [low, high, quantum, none, palette].join();
  if (lastTable.key === key) return lastTable.table;
  const ramp = Uint32Array.from({ length: 256 }, (_, at) => pixelOf(palette.slice(6 * at, 6 * at + 6)));
  const table = new Uint32Array(65536).fill(pixelOf(none.slice(1)));
  const scale = 255 / (high - low);
  for (let value = NOTHING + 1; value < 32768; value++) {
    table[value - NOTHING] = ramp[Math.round(clamp((value * quantum - low) * scale, 0, 255))];
  }
  lastTable = { key, table };
  return table;
}

// rrggbb as the four bytes of an opaque pixel, red in the lowest.
function pixelOf(colour) {
  const rgb = parseInt(colour, 16);
  return ((0xff << 24) | ((rgb & 0xff) << 16) | (rgb & 0xff00) | (rgb >> 16)) >>> 0;
}
