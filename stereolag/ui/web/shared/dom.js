// Elements, SVG drawings and canvases.

import { shortened, ticks } from "./numbers.js";

const SVG = "http://www.w3.org/2000/svg";
const TICK_PX = 65;

/** @returns {any} */
export function element(tag, className = "", ...children) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  made.append(...children);
  return made;
}

export function button(text, act) {
  const made = Object.assign(element("button", "", text), { type: "button" });
  made.addEventListener("click", act);
  return made;
}

// Shows which of some buttons are pressed.
export function showPressed(buttons, isPressed) {
  for (const one of buttons) one.setAttribute("aria-pressed", isPressed(one));
}

// Sets a text that is read aloud when it changes.
export function say(region, text) {
  if (region.textContent !== text) region.textContent = text;
}

/** @returns {any} */
export function node(tag, attributes, ...children) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

// Empties a drawing and returns a function that adds a node to it.
export function emptied(svg) {
  svg.replaceChildren();
  return (tag, attributes, ...children) => {
    const made = node(tag, attributes, ...children);
    svg.append(made);
    return made;
  };
}

// Empties a drawing and sets its size in px.
export function sized(svg, width, height) {
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.style.height = `${height}px`;
  return emptied(svg);
}

// The path through some points.
export const line = (points) => `M${points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join("L")}`;

// The path through some points, as text, with a gap for each that is missing.
export const gapped = (points) => points.map((point, at) => point && `${points[at - 1] ? "L" : "M"}${point}`).filter(Boolean).join("");

// A line from `left` to `right` at `y` with round lags below it; `x` maps a lag to its position.
export function drawAxis(add, { first, last, left, right, y, x }, label = "") {
  add("path", { class: "zero", d: `M${left} ${y}H${right}` });
  for (const tick of ticks(first, last, (TICK_PX * (last - first)) / (x(last) - x(first)))) {
    const place = x(tick);
    const anchor = place < 24 ? "start" : "middle";
    add("path", { class: "zero", d: `M${place} ${y}v4` });
    add("text", { x: anchor === "start" ? left : place, y: y + 16, class: "small faint", "text-anchor": anchor }, shortened(tick));
  }
  if (label) add("text", { x: (left + right) / 2, y: y + 31, class: "small faint", "text-anchor": "middle" }, label);
}

// The boxes of strips that lie below each other, each under its name, and the height of all.
export function stacked(heights, nameHeight, gapBelow) {
  const boxes = {};
  let y = 0;
  for (const [name, height] of Object.entries(heights)) {
    boxes[name] = { top: y + nameHeight, height, bottom: y + nameHeight + height };
    y += nameHeight + height + gapBelow(name);
  }
  return { boxes, height: y };
}

// Draws RGBA bytes on a canvas of their size.
export function put(canvas, { data, rows, cols }) {
  if (canvas.width !== cols || canvas.height !== rows) Object.assign(canvas, { width: cols, height: rows });
  canvas.getContext("2d").putImageData(new ImageData(data, cols, rows), 0, 0);
}
