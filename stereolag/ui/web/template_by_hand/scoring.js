// The products at one place of the template, and their mean: Pearson's correlation over all channels.

import { clamp } from "../shared/numbers.js";

const CHANNELS = 3;

// The template's deviations from the mean of each channel, over the pixels that count; `data` are RGBA bytes.
export function prepared({ data, rows, cols }, counts) {
  const places = [...counts.keys()].filter((at) => counts[at]);
  const deviations = centred(places.map((at) => 4 * at), data);
  return { rows, cols, places, deviations, norm: Math.sqrt(deviations.reduce((sum, value) => sum + value * value, 0)) };
}

// RGB of some pixels minus the mean of each channel. Values relative to the first pixel make a flat window exactly 0.
function centred(starts, data) {
  const values = new Float64Array(CHANNELS * starts.length);
  for (let channel = 0; channel < CHANNELS; channel++) {
    const first = data[starts[0] + channel];
    let sum = 0;
    for (const start of starts) sum += data[start + channel] - first;
    const mean = sum / starts.length;
    starts.forEach((start, index) => (values[CHANNELS * index + channel] = data[start + channel] - first - mean));
  }
  return values;
}

// The score with the template's top-left pixel at (row, col), NaN on a flat window, and the products of the
// pixels that count: their mean is the score.
export function compared(picture, template, row, col) {
  const { places, deviations, norm, cols } = template;
  const starts = places.map((at) => 4 * ((row + Math.floor(at / cols)) * picture.cols + col + (at % cols)));
  const window = centred(starts, picture.data);
  let energy = 0;
  for (const value of window) energy += value * value;
  const products = new Float64Array(places.length);
  if (!energy) return { score: NaN, products };
  const scale = places.length / (norm * Math.sqrt(energy));
  let sum = 0;
  for (let at = 0; at < window.length; at++) {
    const product = window[at] * deviations[at] * scale;
    products[Math.floor(at / CHANNELS)] += product;
    sum += product;
  }
  return { score: clamp(sum / places.length, -1, 1), products };
}
