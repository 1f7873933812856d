// Follows the crosshair of the pictures and explains the window under it, without server requests.

import { cut, element, emptied, gapped, put } from "../shared/dom.js";
import { eventOf, received, tell } from "../shared/exchange.js";
import { clamp, shortened, ticks, total } from "../shared/numbers.js";
import { codesOf, pixelsOf } from "../shared/packing.js";
import { Panel, show } from "../shared/panel.js";
import { explained } from "./scoring.js";

export default (component) => show(HoveredMatchPanel, component);

class HoveredMatchPanel extends Panel {
  constructor(parent) {
    super(parent, "hovered");
    this.reading = this.find(".reading");
    this.parts = {
      window: this.find(".window canvas"),
      above: this.find(".from-above canvas"),
      strip: this.find(".strip canvas"),
      frames: this.find(".strip svg"),
      curve: this.find(".curve"),
    };
    this.at = null;
    this.listen(eventOf("crosshair"), ({ detail }) => detail.name === this.settings?.pictures && this.follow(detail.at));
    this.listen(eventOf("pair"), ({ detail }) => detail.name === this.settings?.pictures && this.takePair());
    this.watchSize(this.root);
  }

  load(settings) {
    this.settings = settings;
    const { colours, words } = settings;
    this.colour({ window: colours.peak, curve: colours.curve });
    this.root.setAttribute("aria-label", words.title);
    [["window", words.window], ["from-above", words.above], ["search", words.axis]].forEach(([name, text]) => {
      this.find(`.${name} figcaption`).textContent = text;
    });
    this.takePair();
    this.schedule();
  }

  // Decodes the pair that belongs to the settings once, as soon as it has arrived.
  async takePair() {
    const item = received("pair", this.settings.pictures);
    if (!item || item === this.item) return;
    this.item = item;
    const pair = await pairOf(item);
    if (item !== this.item) return; // a newer pair overtook this one
    this.pair = pair;
    this.schedule();
  }

  follow(at) {
    const left = this.at && !at;
    this.at = at;
    if (left) this.mark(received("description", this.settings.pictures)?.marks ?? []);
    this.schedule();
  }

  draw() {
    const { pair, settings } = this;
    // While a new pair is on its way, the previous one is still there for a moment.
    if (!pair || pair.digest !== settings.digest || !this.root.clientWidth) return;
    const { row, col } = this.at ?? settings.pixel;
    if (row >= pair.rows || col >= pair.cols) return;
    const seen = explained(pair, settings, row, col);
    const found = places(seen, pair.truth(row, col), settings);
    cut(this.parts.window, pair.images[0], seen.start, seen.top, seen.size, seen.size);
    const across = drawStrip(this.parts, seen, found, pair);
    drawCurve(this.parts.curve, seen, found, settings, across);
    drawFromAbove(this.parts.above, seen, found, settings);
    this.describe(row, col, seen, found);
    if (this.at) this.mark(this.frames(seen, found));
  }

  describe(row, col, seen, found) {
    const { words } = this.settings;
    const listed = [...found].reverse().flatMap(({ name, colour, dy, dx, score }) => {
      const swatch = element("span", "swatch");
      swatch.style.background = colour;
      const aside = dy ? `, ${shortened(Math.abs(dy), 0, "px")} ${dy > 0 ? words.down : words.up}` : "";
      const scored = Number.isNaN(score) ? "" : `: ${shortened(score, this.settings.score === "cross" ? 0 : 3)}`;
      return [" ", swatch, `${name} ${shortened(-dx, Number.isInteger(dx) ? 0 : 2, "px")}${aside}${scored}`];
    });
    const where = `${words.row} ${row}, ${words.column} ${col}`;
    this.reading.replaceChildren(`${where}: `, element("span", "kind", words.kinds[seen.kind]), ...listed);
    this.parts.window.setAttribute("aria-label", `${words.window}: ${where}`);
    for (const scores of [this.parts.above, this.parts.curve]) scores.setAttribute("aria-label", this.reading.textContent);
  }

  frames(seen, found) {
    const { top, start, size, asked } = seen;
    const { colours } = this.settings;
    const frame = (picture, row, col, height, width, colour, style = {}) => ({
      row, col, height, width, colour, label: "", to: null, dashed: false, filled: false, pictures: [picture], ...style,
    });
    const height = asked.dy_last - asked.dy_first + size;
    const width = asked.dx_last - asked.dx_first + size;
    return [
      frame(1, top + asked.dy_first, start + asked.dx_first, height, width, colours.search, { dashed: true, filled: true }),
      frame(0, top, start, size, size, colours.peak),
      ...found.map(({ dy, dx, colour }) => frame(1, top + dy, start + dx, size, size, colour, { dashed: colour === colours.truth })),
    ];
  }

  mark(marks) {
    tell("marks", { name: this.settings.pictures, item: { marks } });
  }
}

// Both images of a pair in grey and its ground truth, for the panel that follows the pointer.

const TRUTH_SCALE = 64;
const TRUTH_ZERO = 512;

// Unpacks the item of stereolag.ui.components.packed_grey_pair.
async function pairOf({ parts, rows, cols, digest }) {
  const [left, right, truth] = await Promise.all(parts.map(pixelsOf));
  const red = ({ data }) => Uint8Array.from({ length: rows * cols }, (_, at) => data[4 * at]);
  const codes = truth && codesOf(truth);
  return {
    digest,
    rows,
    cols,
    left: red(left),
    right: red(right),
    images: [left.image, right.image],
    deviation: deviation(red(left)),
    truth: (row, col) => {
      const code = codes ? codes[row * cols + col] : 0;
      return code ? code / TRUTH_SCALE - TRUTH_ZERO : NaN;
    },
  };
}

function deviation(values) {
  const mean = total(values) / values.length;
  return Math.sqrt(values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / values.length);
}

// The panel beside the pictures: the window, the strip of the right image searched for it, and the score at every lag.

const STRIP_PX = [28, 64];
const CURVE_PX = 150;
const EDGES = { top: 22, bottom: 22 };
const TICK_PX = 46;

// The places to frame, the most important last: {name, colour, dy, dx, score}.
function places(seen, truth, settings) {
  const named = (name, lag) => (lag ? [{ name: settings.words[name], colour: settings.colours[name], ...lag }] : []);
  const { dx_first: first, dx_last: last, dy_first: up, dy_last: down } = seen.asked;
  const dx = -truth;
  const searched = !Number.isNaN(truth) && dx >= first - 0.5 && dx <= last + 0.5 && up <= 0 && down >= 0;
  const score = searched ? seen.scores[-up * seen.cols + clamp(Math.round(dx), first, last) - first] : NaN;
  return [
    ...named("runner_up", seen.runnerUp),
    ...named("truth", Number.isNaN(truth) ? null : { dy: 0, dx, score }),
    ...named("peak", seen.peak),
  ];
}

function drawStrip(parts, seen, found, pair) {
  const { size, top, start, asked } = seen;
  const first = start + asked.dx_first;
  const width = asked.dx_last - asked.dx_first + size;
  const row = top + (seen.peak?.dy ?? 0);
  cut(parts.strip, pair.images[1], first, row, width, size);
  const shown = parts.strip.parentElement.clientWidth || 1;
  const scale = shown / width;
  const height = clamp(size * scale, STRIP_PX[0], STRIP_PX[1]);
  parts.strip.parentElement.style.height = `${height}px`;
  const add = emptied(parts.frames);
  for (const { dy, dx, colour } of found) {
    if (dy !== (seen.peak?.dy ?? 0)) continue;
    const box = { x: (start + dx - first) * scale + 1, y: 2, width: size * scale - 2, height: height - 4 };
    add("rect", { ...box, class: "halo" });
    add("rect", { ...box, class: "frame", stroke: colour });
  }
  // Maps a lag to the middle of the window, so that the curve lines up with the strip above it.
  return (dx) => (dx - asked.dx_first + size / 2) * scale;
}

function drawCurve(svg, seen, found, settings, across) {
  const { scores, cols, asked } = seen;
  const line = ((seen.peak?.dy ?? clamp(0, asked.dy_first, asked.dy_last)) - asked.dy_first) * cols;
  const [low, high] = scoreRange(scores, settings.score);
  const up = (score) => EDGES.top + ((high - score) / (high - low || 1)) * (CURVE_PX - EDGES.top - EDGES.bottom);
  const add = emptied(svg);
  const [west, east] = [across(asked.dx_first), across(asked.dx_last)];
  for (const level of settings.score === "zncc" || settings.score === "ncc" ? [0, 1] : [0]) {
    if (level < low || level > high) continue;
    add("path", { class: "axis", d: `M${west} ${up(level)}H${east}` });
    add("text", { class: "faint", x: Math.max(west - 6, 8), y: up(level) + 4, "text-anchor": "end" }, level);
  }
  for (const disparity of ticks(-asked.dx_last, -asked.dx_first, (cols / (east - west || 1)) * TICK_PX)) {
    add("text", { class: "faint", x: across(-disparity), y: CURVE_PX - 4, "text-anchor": "middle" }, shortened(disparity));
  }
  const along = Array.from(scores.slice(line, line + cols));
  const points = along.map((score, at) => (Number.isNaN(score) ? null : `${across(asked.dx_first + at)} ${up(score)}`));
  add("path", { class: "scores", d: gapped(points) });
  for (const { name, dy, dx, score, colour } of found) {
    const x = across(dx);
    if (name === settings.words.truth) {
      add("path", { class: "truth", stroke: colour, d: `M${x} ${EDGES.top - 8}V${CURVE_PX - EDGES.bottom}` });
    } else if (dy === (seen.peak?.dy ?? 0)) {
      add("circle", { class: "place", cx: x, cy: up(score), r: 6, stroke: colour });
    }
  }
}

function scoreRange(scores, score) {
  let [low, high] = [Infinity, -Infinity];
  for (const one of scores) if (!Number.isNaN(one)) [low, high] = [Math.min(low, one), Math.max(high, one)];
  if (low > high) return [0, 1];
  if (score === "zncc") return [Math.min(low, -0.2), 1];
  return score === "ncc" ? [low, 1] : [low, high];
}

// Draws all scores of a search in both directions, dx to the right as along the strip.
function drawFromAbove(canvas, seen, found, settings) {
  canvas.parentElement.hidden = seen.rows === 1;
  if (seen.rows === 1) return;
  const context = canvas.getContext("2d");
  const data = new Uint8ClampedArray(4 * seen.scores.length);
  const [low, high] = scoreRange(seen.scores, settings.score);
  seen.scores.forEach((score, at) => {
    if (Number.isNaN(score)) return;
    const share = (score - low) / (high - low || 1);
    const colour = settings.palette[Math.round(clamp(share, 0, 1) * (settings.palette.length - 1))];
    data.set([...colour, 255], 4 * at);
  });
  put(canvas, { data, rows: seen.rows, cols: seen.cols });
  for (const { dy, dx, colour } of found) {
    context.strokeStyle = colour;
    context.lineWidth = Math.max(1, seen.cols / 48);
    context.strokeRect(Math.round(dx) - seen.asked.dx_first - 1, dy - seen.asked.dy_first - 1, 3, 3);
  }
}
