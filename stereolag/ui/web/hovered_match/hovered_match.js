// Follows the crosshair of the pictures and explains the window under it, without server requests.

import { cut, gapped, put } from "../shared/dom.js";
import { eventOf, received, tell } from "../shared/exchange.js";
import { clamp, shortened, ticks } from "../shared/numbers.js";
import { codesOf, pixelsOf } from "../shared/packing.js";
import { Panel } from "../shared/panel.js";
import { explained } from "./scoring.js";

export default class HoveredMatchPanel extends Panel {
  pointed = null; // the pixel under the pointer
  seen = null; // the match of that pixel, or of the pixel in the settings
  found = []; // its places
  where = "";
  layout = { width: 0, height: 0, frames: [] }; // the layout of the strip and of the curve

  setUp() {
    this.listen(eventOf("crosshair"), ({ detail }) => detail.name === this.data.pictures && this.follow(detail.at));
    this.listen(eventOf("pair"), ({ detail }) => detail.name === this.data.pictures && this.takePair());
  }

  begin() {
    this.takePair();
  }

  // Decodes the pair that belongs to the settings once, as soon as it has arrived.
  async takePair() {
    const item = received("pair", this.data.pictures);
    if (!item || item === this.item) return;
    this.item = item;
    const pair = await pairOf(item);
    if (item !== this.item) return; // a newer pair overtook this one
    this.pair = pair;
    this.schedule();
  }

  follow(at) {
    if (this.pointed && !at) this.mark(received("description", this.data.pictures)?.marks ?? []);
    this.pointed = at;
    this.schedule();
  }

  draw() {
    const { pair, data } = this;
    const strip = this.find(".strip");
    // While a new pair is on its way, the previous one is still there for a moment.
    if (pair?.digest !== data.digest || !this.root.clientWidth) return;
    const { row, col } = this.pointed ?? data.pixel;
    if (row >= pair.rows || col >= pair.cols) return;
    const seen = explained(pair, data, row, col);
    const found = places(seen, pair.truth(row, col), data);
    Object.assign(this, { seen, found, where: `${data.words.row} ${row}, ${data.words.column} ${col}` });
    this.layout = laidOut(strip.clientWidth || 1, seen, found, data);
    this.render();
    const { top, start, size, asked } = seen;
    cut(this.find(".window canvas"), pair.images[0], start, top, size, size);
    const width = asked.dx_last - asked.dx_first + size;
    cut(strip.querySelector("canvas"), pair.images[1], start + asked.dx_first, top + (seen.peak?.dy ?? 0), width, size);
    if (seen.rows > 1) drawFromAbove(this.find(".from-above canvas"), seen, data);
    if (this.pointed) this.mark(this.frames());
  }

  // The places found in words, the most important first.
  told() {
    const { words, score: kind } = this.data;
    return [...this.found].reverse().map(({ name, colour, dy, dx, score }) => {
      const aside = dy ? `, ${shortened(Math.abs(dy), 0, "px")} ${dy > 0 ? words.down : words.up}` : "";
      const scored = Number.isNaN(score) ? "" : `: ${shortened(score, kind === "cross" ? 0 : 3)}`;
      return { colour, text: `${name} ${shortened(-dx, Number.isInteger(dx) ? 0 : 2, "px")}${aside}${scored}` };
    });
  }

  get reading() {
    if (!this.seen) return "";
    return `${this.where}: ${[this.data.words.kinds[this.seen.kind], ...this.told().map(({ text }) => text)].join(" ")}`;
  }

  frames() {
    const { top, start, size, asked } = this.seen;
    const { colours } = this.data;
    const frame = (picture, colour, dy, dx, style = {}, height = size, width = size) => ({
      pictures: [picture], colour, row: top + dy, col: start + dx, height, width, ...style,
    });
    const [height, width] = [asked.dy_last - asked.dy_first + size, asked.dx_last - asked.dx_first + size];
    return [
      frame(1, colours.search, asked.dy_first, asked.dx_first, { dashed: true, filled: true }, height, width),
      frame(0, colours.peak, 0, 0),
      ...this.found.map(({ dy, dx, colour }) => frame(1, colour, dy, dx, { dashed: colour === colours.truth })),
    ];
  }

  mark(marks) {
    tell("marks", { name: this.data.pictures, item: { marks } });
  }
}

// Both images of a pair in grey, and its ground truth.

const TRUTH_SCALE = 64;
const TRUTH_ZERO = 512;

// Unpacks the item of stereolag.ui.components.packed_grey_pair.
async function pairOf({ parts, rows, cols, digest, deviation }) {
  const [left, right, truth] = await Promise.all(parts.map(pixelsOf));
  const red = ({ data }) => Uint8Array.from({ length: rows * cols }, (_, at) => data[4 * at]);
  const codes = truth && codesOf(truth);
  return {
    digest, rows, cols, deviation,
    left: red(left),
    right: red(right),
    images: [left.image, right.image],
    truth: (row, col) => {
      const code = codes ? codes[row * cols + col] : 0;
      return code ? code / TRUTH_SCALE - TRUTH_ZERO : NaN;
    },
  };
}

// The panel beside the pictures: the window, the strip of the right image searched for it, and the score at every lag.

const STRIP_PX = [28, 64];
const CURVE = { top: 22, bottom: 128 };
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
    ...named("truth", Number.isNaN(truth) ? null : { dy: 0, dx, score, isTruth: true }),
    ...named("peak", seen.peak),
  ];
}

// The curve below the strip: `x` maps a lag to the middle of the window, so that both line up.
function laidOut(width, { size, scores, cols, peak, asked }, found, { score: kind }) {
  const scale = width / (asked.dx_last - asked.dx_first + size);
  const height = clamp(size * scale, STRIP_PX[0], STRIP_PX[1]);
  const x = (dx) => (dx - asked.dx_first + size / 2) * scale;
  const [low, high] = scoreRange(scores, kind);
  const y = (score) => CURVE.top + ((high - score) / (high - low || 1)) * (CURVE.bottom - CURVE.top);
  const [west, east] = [x(asked.dx_first), x(asked.dx_last)];
  const dy = peak?.dy ?? 0;
  const line = ((peak?.dy ?? clamp(0, asked.dy_first, asked.dy_last)) - asked.dy_first) * cols;
  const along = Array.from(scores.slice(line, line + cols));
  const inLine = found.filter((one) => one.dy === dy);
  return {
    width, height, x, y, west, east,
    frames: inLine.map((one) => ({
      x: (one.dx - asked.dx_first) * scale + 1, width: size * scale - 2, height: height - 4, colour: one.colour,
    })),
    levels: (kind === "zncc" || kind === "ncc" ? [0, 1] : [0]).filter((level) => level >= low && level <= high),
    ticks: ticks(-asked.dx_last, -asked.dx_first, (cols / (east - west || 1)) * TICK_PX),
    scores: gapped(along.map((score, at) => (Number.isNaN(score) ? null : `${x(asked.dx_first + at)} ${y(score)}`))),
    places: found.filter((one) => one.isTruth || one.dy === dy),
  };
}

function scoreRange(scores, score) {
  let [low, high] = [Infinity, -Infinity];
  for (const one of scores) if (!Number.isNaN(one)) [low, high] = [Math.min(low, one), Math.max(high, one)];
  if (low > high) return [0, 1];
  if (score === "zncc") return [Math.min(low, -0.2), 1];
  return score === "ncc" ? [low, 1] : [low, high];
}

// Draws all scores of a search in both directions, dx to the right as along the strip.
function drawFromAbove(canvas, seen, settings) {
  const data = new Uint8ClampedArray(4 * seen.scores.length);
  const [low, high] = scoreRange(seen.scores, settings.score);
  const last = settings.palette.length - 1;
  seen.scores.forEach((score, at) => {
    const share = (score - low) / (high - low || 1);
    if (!Number.isNaN(score)) data.set([...settings.palette[Math.round(share * last)], 255], 4 * at);
  });
  put(canvas, { data, rows: seen.rows, cols: seen.cols });
}
