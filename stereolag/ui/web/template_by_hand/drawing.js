// The drawings: enlarged pieces, the products of their pixels, the score map, and the relief around a peak.

import { clamp } from "../shared/numbers.js";

const WARM = [224, 104, 56];
const COOL = [58, 130, 190];
const STRONG = 3; // times the mean product of a perfect match

// The pixels of the picture under the template.
export function cutOut(picture, { rows, cols }, row, col) {
  const data = new Uint8ClampedArray(4 * rows * cols);
  for (let line = 0; line < rows; line++) {
    const start = 4 * ((row + line) * picture.cols + col);
    data.set(picture.data.subarray(start, start + 4 * cols), 4 * line * cols);
  }
  return { rows, cols, data };
}

// Warm where a pixel agrees, cool where it disagrees, stronger with the product; pixels that do not count stay clear.
export function inProductColours({ rows, cols, places }, products) {
  const data = new Uint8ClampedArray(4 * rows * cols);
  places.forEach((at, index) => {
    data.set(products[index] > 0 ? WARM : COOL, 4 * at);
    data[4 * at + 3] = 30 + 225 * Math.min(1, Math.sqrt(Math.abs(products[index]) / STRONG));
  });
  return { rows, cols, data };
}

// The colour of a score: the darkest at 0 and below, the brightest at 1, grey where there is no score.
export function colourOf(score, palette) {
  if (Number.isNaN(score)) return [140, 140, 140];
  return palette[Math.round(clamp(score, 0, 1) * (palette.length - 1))];
}

// The scores around a place, seen from the front and above, far rows first; equal heights always mean equal scores.
export function drawRelief(canvas, map, place, reach, palette) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
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
      const mean = heights.reduce((sum, value) => sum + value, 0) / 4;
      const light = 1 + 1.2 * clamp(heights[1] - heights[0], -0.3, 0.3); // lit from the left
      context.fillStyle = `rgb(${colourOf(mean, palette).map((value) => Math.min(255, Math.round(value * light)))})`;
      context.strokeStyle = context.fillStyle;
      context.lineWidth = 0.7;
      context.beginPath();
      corners.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
      context.closePath();
      context.fill();
      context.stroke();
    }
  }
}
