// The scores of one window and their interpretation: stereolag.assess.explaining.explain_match in the browser.
// Lags are displacements, right minus left, px; a lag range has the fields dy_first, dy_last, dx_first and dx_last.

import { clamp } from "../shared/numbers.js";

const FLAT = 0.25; // a window of whole numbers is flat up to this energy about its mean

// {top, start, rows, cols, dy, dx, scores, peak, runnerUp, kind, …}; `scores` contains the lags of `asked`, row by row.
export function explained(pair, settings, row, col) {
  const { window_size: size, step, tried, asked } = settings;
  const startOf = (at, end) => clamp(Math.floor((at - ((size - step) >> 1)) / step), 0, Math.floor((end - size) / step)) * step;
  const [top, start] = [startOf(row, pair.rows), startOf(col, pair.cols)];
  const window = windowAt(pair.left, pair.cols, top, start, size);
  const every = scoresOf(pair, settings, window, top, start);
  const [rows, cols] = [asked.dy_last - asked.dy_first + 1, asked.dx_last - asked.dx_first + 1];
  const scores = new Float64Array(rows * cols);
  const triedCols = tried.dx_last - tried.dx_first + 1;
  for (let at = 0; at < scores.length; at++) {
    const [dy, dx] = [asked.dy_first + Math.floor(at / cols), asked.dx_first + (at % cols)];
    scores[at] = every[(dy - tried.dy_first) * triedCols + dx - tried.dx_first];
  }
  const lagAt = (at) => ({ dy: asked.dy_first + Math.floor(at / cols), dx: asked.dx_first + (at % cols), score: scores[at] });
  const best = highest(every, tried);
  const inside = best !== null && within(best, asked);
  const peak = inside ? best : highest(scores, asked);
  const seen = { top, start, size, rows, cols, asked, scores, peak, runnerUp: null, valley: NaN, flank: NaN };
  seen.contrast = Math.sqrt(window.energy / size ** 2) / (pair.deviation || 1);
  seen.atEdge = peak !== null && (!inside || (!settings.circular && touchesFrame(pair, seen)));
  if (peak) {
    seen.asGood = settings.ambiguous_margin * Math.abs(peak.score);
    if (settings.score === "ncc") seen.asGood *= window.energy / (window.square || 1);
    const at = (peak.dy - asked.dy_first) * cols + peak.dx - asked.dx_first;
    const heights = passes(scores, rows, cols, at, settings.circular);
    let second = -1;
    for (let other = 0; other < scores.length; other++) {
      if (Number.isNaN(scores[other])) continue;
      if (scores[other] - heights[other] > seen.asGood) {
        if (second < 0 || scores[other] > scores[second]) second = other;
      } else if (Math.abs(Math.floor(other / cols) - Math.floor(at / cols)) > 1 || Math.abs((other % cols) - (at % cols)) > 1) {
        if (!(seen.flank >= scores[other])) seen.flank = scores[other];
      }
    }
    if (second >= 0) Object.assign(seen, { runnerUp: lagAt(second), valley: heights[second] });
  }
  seen.kind = kindOf(seen, settings);
  return seen;
}

function windowAt(image, stride, top, start, size) {
  const pixels = new Float64Array(size * size);
  let [total, square] = [0, 0];
  for (let row = 0, at = 0; row < size; row++) {
    for (let col = 0; col < size; col++, at++) {
      const value = image[(top + row) * stride + start + col];
      pixels[at] = value;
      total += value;
      square += value * value;
    }
  }
  return { pixels, total, square, energy: square - total ** 2 / size ** 2 };
}

// The score at every lag tried, NaN where there is no candidate.
function scoresOf(pair, { window_size: size, tried, score, circular }, window, top, start) {
  const cols = tried.dx_last - tried.dx_first + 1;
  const scores = new Float64Array((tried.dy_last - tried.dy_first + 1) * cols).fill(NaN);
  if (window.energy <= FLAT) return scores;
  const patch = circular ? windowAt(pair.right, pair.cols, top, start, size).pixels : null;
  for (let at = 0; at < scores.length; at++) {
    const [dy, dx] = [tried.dy_first + Math.floor(at / cols), tried.dx_first + (at % cols)];
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

// The lag of the highest score; of equal ones, the shortest.
function highest(scores, lags) {
  const cols = lags.dx_last - lags.dx_first + 1;
  let best = null;
  for (let at = 0; at < scores.length; at++) {
    const found = { dy: lags.dy_first + Math.floor(at / cols), dx: lags.dx_first + (at % cols), score: scores[at] };
    if (Number.isNaN(found.score) || (best && found.score < best.score)) continue;
    if (!best || found.score > best.score || found.dy ** 2 + found.dx ** 2 < best.dy ** 2 + best.dx ** 2) best = found;
  }
  return best;
}

function within({ dy, dx }, lags) {
  return dy >= lags.dy_first && dy <= lags.dy_last && dx >= lags.dx_first && dx <= lags.dx_last;
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
