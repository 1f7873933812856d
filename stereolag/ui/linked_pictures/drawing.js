// Pictures, marks, and the text of readings.

const SVG = "http://www.w3.org/2000/svg";
const LOADING_MS = 10_000;

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

function drawn(tag, attributes, parent) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  parent.append(made);
  return made;
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
function metric(metres, error, unit) {
  return shortened(metres, clamp(1 - Math.floor(Math.log10(error)), 0, 4), unit);
}

function picture(described, { image, readings }, colours) {
  const read = readings.map((reading, index) => ({ ...reading, depth: described.depths[index] }));
  const seen = image ? described.digest : [described.digest, colours.low, colours.high, colours.palette].join();
  return { ...described, image, readings: read, colours, seen };
}

// The element that shows a picture; each place it is shown at needs its own.
function surface(one) {
  const made = element(one.image ? "img" : "canvas");
  if (one.image) made.draggable = false;
  else made.setAttribute("role", "img");
  fill(made, one);
  return made;
}

// Draws a picture on a surface, unless the surface already shows it in the same colours.
function fill(made, { title, alternative, image, readings, colours, seen }) {
  made.setAttribute(image ? "alt" : "aria-label", alternative ? `${title}: ${alternative}` : title);
  if (made.seen === seen) return;
  made.seen = seen;
  if (image) made.src = image.src;
  else paint(made, readings[0], colours);
}

// An element that has just been given the picture may still be loading it.
function forget({ image }) {
  if (image) setTimeout(() => URL.revokeObjectURL(image.src), LOADING_MS);
}

function figures(all) {
  return all.map(({ label, value, meaning }) => {
    const one = element("div", "", element("dt", "", label), element("dd", "", value));
    one.title = meaning;
    return one;
  });
}

function drawMark(mark, pixel, svg) {
  const x = mark.height ? mark.col : mark.col + 0.5;
  const y = mark.height ? mark.row : mark.row + 0.5;
  let d = `M${x} ${y}h0`;
  let [width, halo] = [9, 13];
  if (mark.height) [d, width, halo] = [`M${x} ${y}h${mark.width}v${mark.height}h${-mark.width}z`, 2, 4];
  if (mark.to) [d, width, halo] = [`M${x} ${y}L${mark.to[1] + 0.5} ${mark.to[0] + 0.5}`, 2, 4];
  const dash = mark.dashed ? { "stroke-dasharray": "6 4" } : {};
  drawn("path", { d, class: "halo", "stroke-width": halo, "stroke-linecap": "round" }, svg);
  if (mark.filled) drawn("path", { d, style: `fill: ${mark.colour}`, "fill-opacity": 0.22 }, svg);
  drawn("path", { d, stroke: mark.colour, "stroke-width": width, "stroke-linecap": mark.dashed ? "butt" : "round", ...dash }, svg);
  if (mark.label) {
    const [dx, dy] = mark.height ? [0, -5] : [9, -7];
    const text = drawn("text", { x: x + dx * pixel, y: y + dy * pixel, "font-size": 13 * pixel }, svg);
    text.textContent = mark.label;
  }
}
