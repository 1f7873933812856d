// Pictures, marks, outlines, and the text of readings.

import { put } from "../shared/dom.js";
import { unzlibSync } from "../shared/fflate.js";
import { html } from "../shared/lit_html.js";
import { clamp, shortened } from "../shared/numbers.js";

const LOADING_MS = 10_000;

// A picture with its content, and a key that tells whether an element shows it already.
export function picture(described, { image, readings }, colours) {
  const read = readings.map((reading, index) => ({ ...reading, depth: described.depths[index] }));
  const seen = image ? described.digest : [described.digest, colours.low, colours.high, colours.palette].join();
  return { ...described, image, readings: read, colours, seen };
}

// The element that shows a picture; a map is yet to be painted on its canvas.
export function surface(one) {
  const label = one.alternative ? `${one.title}: ${one.alternative}` : one.title;
  return one.image
    ? html`<img draggable="false" alt=${label} src=${one.image.src} />`
    : html`<canvas role="img" aria-label=${label} .shows=${one}></canvas>`;
}

// An element that was just given the picture may still be loading it.
export function forget({ image }) {
  if (image) setTimeout(() => URL.revokeObjectURL(image.src), LOADING_MS);
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

// A number with the decimals that the error leaves certain, and one more.
function metric(metres, error, unit = "") {
  return shortened(metres, clamp(1 - Math.floor(Math.log10(error)), 0, 4), unit);
}

// A mark as SVG: a point, a frame, or a line to another point; `pixel` is the size of a screen pixel.
export function shapeOf({ row, col, height, width, to, dashed, ...mark }, pixel) {
  const [x, y] = height ? [col, row] : [col + 0.5, row + 0.5];
  const end = to ? `L${to[1] + 0.5} ${to[0] + 0.5}` : "h0";
  const [dx, dy] = height ? [0, -5] : [9, -7];
  return {
    ...mark,
    d: `M${x} ${y}${height ? `h${width}v${height}h${-width}z` : end}`,
    width: height || to ? 2 : 9,
    halo: height || to ? 4 : 13,
    cap: dashed ? "butt" : "round",
    dash: dashed ? "6 4" : "none",
    x: x + dx * pixel, y: y + dy * pixel, size: 13 * pixel,
  };
}

// Unpacks the item of a picture into its pixels and readings, and colours maps.

const NOTHING = -32768;
const LONG = 128;

// The inverse of stereolag.ui.linked_pictures.packed. Everything but photographs is unpacked synchronously: an
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

// Draws the map that a canvas shows, unless it already does in the same colours, which all maps share.
export function paint(canvas) {
  const { readings: [reading], colours, seen } = canvas.shows;
  if (canvas.seen === seen) return;
  canvas.seen = seen;
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
  const table = new Uint32Array(65536).fill(pixelOf(none));
  const scale = 255 / (high - low);
  for (let value = NOTHING + 1; value < 32768; value++) {
    table[value - NOTHING] = ramp[Math.round(clamp((value * quantum - low) * scale, 0, 255))];
  }
  lastTable = { key, table };
  return table;
}

// bbggrr as the four bytes of an opaque pixel, red in the lowest.
const pixelOf = (colour) => 0xff000000 + parseInt(colour, 16);
