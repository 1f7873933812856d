// Paths and axes of SVG drawings, and canvases.

import { svg } from "./lit_html.js";
import { shortened, ticks } from "./numbers.js";

const TICK_PX = 65;
const NAME = 20; // px for the name above each strip

// The path through some points, as text, with a gap for each missing one; a single point is a dot.
export const gapped = (points) =>
  points.map((one, at) => (one ? (points[at - 1] ? `L${one}` : `M${one}h0`) : "")).join("");

// The path through values, one unit apart to the right, upwards, with a gap for each missing one.
export const plotted = (values, first = 0) =>
  gapped(values.map((value, at) => Number.isFinite(value) && `${first + at} ${-value}`));

// The runs of places that are not missing, each a list of places.
export function runsOf(those) {
  const runs = [];
  those.forEach((one, at) => {
    if (one && those[at - 1]) runs.at(-1).push(at);
    else if (one) runs.push([at]);
  });
  return runs;
}

// A line from `left` to `right` at `y` with round lags below it; `x` maps a lag to its position.
export function axis({ first, last, left, right, y, x }, label = "") {
  return svg`
    <path class="zero" d="M${left} ${y}H${right}" />
    ${ticks(first, last, (TICK_PX * (last - first)) / (x(last) - x(first))).map((tick) => {
      const start = x(tick) < 24;
      return svg`
        <path class="zero" d="M${x(tick)} ${y}v4" />
        <text class="small faint" x=${start ? left : x(tick)} y=${y + 16} text-anchor=${start ? "start" : "middle"}>
          ${shortened(tick)}</text>`;
    })}
    ${label && svg`<text class="small faint" x=${(left + right) / 2} y=${y + 31} text-anchor="middle">${label}</text>`}`;
}

// The boxes of strips below each other, each under its name, and their total height.
export function stacked(heights, gapBelow) {
  const boxes = {};
  let y = 0;
  for (const [name, height] of Object.entries(heights)) {
    boxes[name] = { top: y + NAME, height, bottom: y + NAME + height };
    y += NAME + height + gapBelow(name);
  }
  return { boxes, height: y };
}

// The position of a pointer over an element, as fractions of its width and height.
export function shareOf({ clientX, clientY }, one) {
  const { left, top, width, height } = one.getBoundingClientRect();
  return [(clientX - left) / width, (clientY - top) / height];
}

// The row and column of a pointer over a picture, in fractions of a pixel.
export function placeIn(event, one, { rows, cols }) {
  const [right, down] = shareOf(event, one);
  return [down * rows, right * cols];
}

// Lengths in px of a picture, by their names in CSS, as the style of an element in it.
export function within({ rows, cols }, lengths) {
  const share = (name) => (100 * lengths[name]) / (name === "left" || name === "width" ? cols : rows);
  return Object.keys(lengths).map((name) => `${name}: ${share(name)}%`).join("; ");
}

// Shows an image, or a rectangle of it, on a canvas of its size.
export function cut(canvas, image, x = 0, y = 0, width = image.width, height = image.height) {
  Object.assign(canvas, { width, height });
  canvas.getContext("2d").drawImage(image, x, y, width, height, 0, 0, width, height);
}

// Draws RGBA bytes on a canvas of their size.
export function put(canvas, { data, rows, cols }) {
  if (canvas.width !== cols || canvas.height !== rows) Object.assign(canvas, { width: cols, height: rows });
  canvas.getContext("2d").putImageData(new ImageData(data, cols, rows), 0, 0);
}
