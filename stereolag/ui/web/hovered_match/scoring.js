// The scores of one window and their interpretation: stereolag.assess.explaining.explain_match in the browser.
// Lags are displacements, right minus left, px; a lag range has the fields dy_first, dy_last, dx_first and dx_last.

import { clamp, total } from "../shared/numbers.js";

const FLAT = 0.25; // a window of whole numbers is flat up to this energy about its mean

// The lags of a range, row by row: how many, the lag at an index, and the index of a lag.
function gridOf({ dy_first, dy_last, dx_first, dx_last }) {
  const [rows, cols] = [dy_last - dy_first + 1, dx_last - dx_first + 1];
  const lagAt = (index) => ({ dy: dy_first + Math.floor(index / cols), dx: dx_first + (index % cols) });
  const indexOf = ({ dy, dx }) => (dy - dy_first) * cols + dx - dx_first;
  const contains = ({ dy, dx }) => dy >= dy_first && dy <= dy_last && dx >= dx_first && dx <= dx_last;
  return { rows, cols, count: rows * cols, lagAt, indexOf, contains };
}

// {top, start, rows, cols, dy, dx, scores, peak, runnerUp, kind, …}; `scores` contains the lags of `asked`, row by row.
export function explained(pair, settings, row, col) {
  const { window_size: size, step, asked } = settings;
  const startOf = (at, end) => clamp(Math.floor((at - ((size - step) >> 1)) / step), 0, Math.floor((end - size) / step)) * step;
  const [top, start] = [startOf(row, pair.rows), startOf(col, pair.cols)];
  const [tried, grid] = [gridOf(settings.tried), gridOf(asked)];
  const window = windowAt(pair.left, pair.cols, top, start, size);
  const every = scoresOf(pair, settings, tried, window, top, start);
  const scores = Float64Array.from({ length: grid.count }, (_, at) => every[tried.indexOf(grid.lagAt(at))]);
  const best = highest(every, tried);
  const inside = best !== null && grid.contains(best);
  const peak = inside ? best : highest(scores, grid);
  const seen = { top, start, size, rows: grid.rows, cols: grid.cols, asked, scores, peak, runnerUp: null, valley: NaN, flank: NaN };
  seen.contrast = Math.sqrt(window.energy / size ** 2) / (pair.deviation || 1);
  seen.atEdge = peak !== null && (!inside || (!settings.circular && touchesFrame(pair, seen)));
  if (peak) {
    seen.asGood = settings.ambiguous_margin * Math.abs(peak.score);
    if (settings.score === "ncc") seen.asGood *= window.energy / (window.square || 1);
    findRunnerUp(seen, grid, settings.circular);
  }
  seen.kind = kindOf(seen, settings);
  return seen;
}

// The highest score on another hill than the peak's, the valley between them, and the highest on the flank of the peak.
function findRunnerUp(seen, grid, circular) {
  const { scores, peak, rows, cols, asGood } = seen;
  const heights = passes(scores, rows, cols, grid.indexOf(peak), circular);
  let second = -1;
  scores.forEach((score, at) => {
    const { dy, dx } = grid.lagAt(at);
    if (score - heights[at] > asGood) {
      if (second < 0 || score > scores[second]) second = at;
    } else if ((Math.abs(dy - peak.dy) > 1 || Math.abs(dx - peak.dx) > 1) && !(seen.flank >= score) && !Number.isNaN(score)) seen.flank = score;
  });
  if (second >= 0) Object.assign(seen, { runnerUp: { ...grid.lagAt(second), score: scores[second] }, valley: heights[second] });
}

function windowAt(image, stride, top, start, size) {
  const pixelAt = (at) => image[(top + Math.floor(at / size)) * stride + start + (at % size)];
  const pixels = Float64Array.from({ length: size ** 2 }, (_, at) => pixelAt(at));
  const [sum, square] = [total(pixels), total(pixels.map((value) => value ** 2))];
  return { pixels, total: sum, square, energy: square - sum ** 2 / size ** 2 };
}

// The score at every lag tried, NaN where there is no candidate.
function scoresOf(pair, { window_size: size, score, circular }, tried, window, top, start) {
  const scores = new Float64Array(tried.count).fill(NaN);
  if (window.energy <= FLAT) return scores;
  const patch = circular ? windowAt(pair.right, pair.cols, top, start, size).pixels : null;
  for (let at = 0; at < scores.length; at++) {
    const { dy, dx } = tried.lagAt(at);
    const [y, x] = [top + dy, start + dx];
    if (!circular && (y < 0 || x < 0 || y + size > pair.rows || x + size > pair.cols)) continue;
    let [product, total, square] = [0, 0, 0];
    for (let row = 0, from = 0; row < size; row++) {
      const line = circular ? ((((row + dy) % size) + size) % size) * size : (y + row) * pair.cols + x;
      for (let col = 0; col < size; col++, from++) {
        const value = circular ? patch[line + ((((col + dx) % size) + size) % size)] : pair.right[line + col];
        product += window.pixels[from] * value;
        total += value;
        square += value * value;
      }
    }
    scores[at] = scored(score, product, window, total, square, size);
  }
  return scores;
}

function scored(score, product, window, total, square, size) {
  const covariance = product - (window.total * total) / size ** 2;
  if (score === "cross") return covariance;
  const energy = score === "ncc" ? square : square - total ** 2 / size ** 2;
  if (energy <= FLAT) return NaN;
  const [shared, own] = score === "ncc" ? [product, window.square] : [covariance, window.energy];
  return Math.fround(clamp(shared / Math.sqrt(own * energy), -1, 1));
}

// The lag of the highest score; if several are equal, the shortest.
function highest(scores, grid) {
  let best = null;
  scores.forEach((score, at) => {
    if (Number.isNaN(score) || (best && score < best.score)) return;
    const found = { ...grid.lagAt(at), score };
    if (!best || score > best.score || found.dy ** 2 + found.dx ** 2 < best.dy ** 2 + best.dx ** 2) best = found;
  });
  return best;
}

function touchesFrame(pair, { top, start, size, rows, peak }) {
  const [y, x] = [top + peak.dy, start + peak.dx];
  return x === 0 || x === pair.cols - size || (rows > 1 && (y === 0 || y === pair.rows - size));
}

// The lowest score on the best path from the peak to each lag; a lag that scores well above it is on another hill.
function passes(scores, rows, cols, peak, wrapped) {
  const reached = new Float64Array(scores.length).fill(-Infinity);
  reached[peak] = scores[peak];
  const raise = (at) => {
    if (Number.isNaN(scores[at])) return false;
    const [row, col] = [Math.floor(at / cols), at % cols];
    let spread = reached[at];
    for (let down = -1; down <= 1; down++) {
      for (let aside = -1; aside <= 1; aside++) {
        let [y, x] = [row + down, col + aside];
        if (wrapped) [y, x] = [(y + rows) % rows, (x + cols) % cols];
        if (y >= 0 && x >= 0 && y < rows && x < cols) spread = Math.max(spread, reached[y * cols + x]);
      }
    }
    const farther = Math.min(spread, scores[at]);
    if (farther <= reached[at]) return false;
    reached[at] = farther;
    return true;
  };
  for (let moved = true; moved; ) {
    moved = false;
    for (let at = 0; at < scores.length; at++) moved = raise(at) || moved;
    for (let at = scores.length - 1; at >= 0; at--) moved = raise(at) || moved;
  }
  const lowest = scores.reduce((low, score) => (score < low ? score : low), Infinity);
  return reached.map((height) => Math.max(height, lowest));
}

function kindOf(seen, settings) {
  if (!seen.peak) return "nothing";
  if (seen.atEdge) return "at_edge";
  const best = seen.peak.score;
  if (settings.score === "zncc" && best < settings.poor_score) return seen.contrast < settings.bare_contrast ? "bare" : "unlike";
  if (seen.runnerUp && best - seen.runnerUp.score < Math.max(seen.asGood, settings.rival_share * (best - seen.valley))) return "repeats";
  return best - seen.flank < seen.asGood ? "smooth" : "clear";
}
