// Common to the drawings of recordings and their curves: SVG nodes, and an axis of lags.

const SVG = "http://www.w3.org/2000/svg";

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

// Empties a drawing, sets its size in px, and returns a function that adds a node to it.
function emptied(svg, width, height) {
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.style.height = `${height}px`;
  svg.replaceChildren();
  return (name, attributes, text) => {
    const node = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text !== undefined) node.textContent = text;
    svg.append(node);
    return node;
  };
}

// A line from `left` to `right` at `y` with round lags below it; `x` maps a lag to its position.
function drawAxis(add, { first, last, left, right, y, x }, label) {
  const sparse = (65 * (last - first)) / (x(last) - x(first));
  const power = 10 ** Math.floor(Math.log10(sparse));
  const every = [1, 2, 5, 10].map((times) => times * power).find((one) => one >= sparse);
  add("path", { class: "zero", d: `M${left} ${y}H${right}` });
  for (let tick = Math.ceil(first / every) * every; tick <= last; tick += every) {
    const place = x(tick);
    add("path", { class: "zero", d: `M${place} ${y}v4` });
    const anchor = place < 24 ? "start" : "middle";
    add("text", { x: anchor === "start" ? left : place, y: y + 16, class: "small faint", "text-anchor": anchor }, shortened(tick, 0));
  }
  if (label) add("text", { x: (left + right) / 2, y: y + 31, class: "small faint", "text-anchor": "middle" }, label);
}
