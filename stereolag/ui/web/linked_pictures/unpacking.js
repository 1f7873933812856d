// Unpacks the item of a picture into its pixels and readings, and colours maps.

import { unzlibSync } from "../shared/fflate.js";
import { clamp } from "../shared/numbers.js";

export const NOTHING = -32768;
const LONG = 128;

// The reverse of stereolag.ui.packing.packed. Everything but photographs is unpacked synchronously: an
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
export function paint(canvas, reading, colours) {
  const [values, table] = [reading.values(), colourTable(colours, reading.quantum)];
  [canvas.width, canvas.height] = [reading.cols, reading.rows];
  const context = canvas.getContext("2d");
  const image = context.createImageData(canvas.width, canvas.height);
  const pixels = new Uint32Array(image.data.buffer);
  for (let at = 0; at < values.length; at++) pixels[at] = table[values[at] - NOTHING];
  context.putImageData(image, 0, 0);
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
