// The curve of two recordings and its peak, as computed with the FFT by `signals/curves.py` and `signals/peaks.py`.

import { clamp } from "../shared/numbers.js";
import { correlated } from "./fourier.js";
import { dot, highestOf, sumOf } from "./statistics.js";

const EQUAL = 1e-9;
const FLAT = 1e-10;
export const FINE = { reach: 32, positions: 65, kaiser: 6 };

export function normalised(signal) {
  const mean = sumOf(signal) / signal.length;
  const centred = signal.map((value) => value - mean);
  const highest = centred.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  return centred.map((value) => value / highest);
}

function overlapAt({ length: size1 }, { length: size2 }, lag) {
  const start = Math.max(0, -lag);
  return { start, stop: Math.min(size1, size2 - lag) };
}

export function overlapLength(first, second, lag) {
  const { start, stop } = overlapAt(first, second, lag);
  return stop - start;
}

export function partsAt(first, second, lag) {
  const { start, stop } = overlapAt(first, second, lag);
  return [first.subarray(start, stop), second.subarray(start + lag, stop + lag)];
}

export function pearsonAt(first, second, lag) {
  const [one, other] = partsAt(first, second, lag).map((part) => {
    const mean = sumOf(part) / part.length;
    return part.map((value) => value - mean);
  });
  return clamp(dot(one, other) / Math.sqrt(dot(one, one) * dot(other, other)), -1, 1);
}

function runningSums(signal) {
  const [sums, squares] = [new Float64Array(signal.length + 1), new Float64Array(signal.length + 1)];
  signal.forEach((value, i) => {
    sums[i + 1] = sums[i] + value;
    squares[i + 1] = squares[i] + value * value;
  });
  return { sums, squares };
}

// Pearson's correlation times sqrt(overlap / longest overlap), for lags from -reach to reach.
export function correlationCurve(first, second, reach) {
  const products = correlated(first, second, reach);
  const [of1, of2] = [runningSums(first), runningSums(second)];
  const longest = Math.min(first.length, second.length);
  const between = (sums, start, stop) => sums[stop] - sums[start];
  return Float64Array.from({ length: 2 * reach + 1 }, (_, index) => {
    const lag = index - reach;
    const { start, stop } = overlapAt(first, second, lag);
    const overlap = stop - start;
    const sum1 = between(of1.sums, start, stop);
    const sum2 = between(of2.sums, start + lag, stop + lag);
    const energy1 = overlap * between(of1.squares, start, stop) - sum1 * sum1;
    const energy2 = overlap * between(of2.squares, start + lag, stop + lag) - sum2 * sum2;
    const product = products[lag < 0 ? products.length + lag : lag];
    const flat = energy1 <= overlap * FLAT * of1.squares.at(-1) || energy2 <= overlap * FLAT * of2.squares.at(-1);
    return flat ? 0 : (overlap * product - sum1 * sum2) * Math.sqrt(overlap / (longest * energy1 * energy2));
  });
}

// The index of the best lag: of several that fit equally well the smallest, and of two opposites the positive one.
export function peakOf(curve, first, second, reach) {
  const best = highestOf(curve);
  const overlap = (index) => overlapLength(first, second, index - reach);
  const tied = [];
  curve.forEach((value, index) => {
    if (value < (curve[best] - EQUAL) * Math.SQRT1_2) return;
    const share = overlap(index) / overlap(best);
    if (share >= 0.5 && Math.abs(value / Math.sqrt(share) - curve[best]) <= EQUAL) tied.push(index);
  });
  const runs = [];
  tied.forEach((index, i) => {
    if (i && index === tied[i - 1] + 1) runs.at(-1).push(index);
    else runs.push([index]);
  });
  const tops = runs.map((run) => run.reduce((top, index) => (curve[index] > curve[top] ? index : top)));
  return tops.sort((a, b) => Math.abs(a - reach) - Math.abs(b - reach) || b - a)[0];
}

// The first index of the main lobe around a peak and the one after its last: down to half, then to the next minimum.
function mainLobe(curve, peak) {
  let [first, last] = [peak, peak];
  const half = curve[peak] / 2;
  while (first > 0 && (curve[first] >= half || curve[first - 1] <= curve[first])) first--;
  while (last < curve.length - 1 && (curve[last] >= half || curve[last + 1] <= curve[last])) last++;
  return [first, last + 1];
}

// The indices of the curve's maxima of `least` or more, outside the main lobe of `peak`.
export function topsOf(curve, peak, least) {
  const [begin, end] = mainLobe(curve, peak);
  const tops = [];
  for (let i = 1; i < curve.length - 1; i++) {
    const outside = i < begin || i >= end;
    if (outside && curve[i] >= least && curve[i] > curve[i - 1] && curve[i] >= curve[i + 1]) tops.push(i);
  }
  return tops;
}

const bessel = (x) => {
  let [term, sum] = [1, 1];
  for (let k = 1; k < 40; k++) sum += term *= (x / (2 * k)) ** 2;
  return sum;
};

const interpolations = new Map();

function interpolationOf(reach) {
  if (!interpolations.has(reach)) {
    const { positions, kaiser } = FINE;
    const rows = Array.from({ length: positions }, (_, i) =>
      Float64Array.from({ length: 2 * reach + 1 }, (_, j) => {
        const distance = i / (positions - 1) - 0.5 - (j - reach);
        const sinc = distance ? Math.sin(Math.PI * distance) / (Math.PI * distance) : 1;
        return (sinc * bessel(kaiser * Math.sqrt(1 - (distance / (reach + 1)) ** 2))) / bessel(kaiser);
      }),
    );
    interpolations.set(reach, rows);
  }
  return interpolations.get(reach);
}

// The position of the peak near `top` between samples: interpolation by a Kaiser-windowed sinc, then a parabola.
export function refinedPeak(curve, top) {
  const reach = Math.min(FINE.reach, top, curve.length - 1 - top);
  if (!reach) return top;
  const window = curve.slice(top - reach, top + reach + 1);
  const fine = interpolationOf(reach).map((row) => dot(row, window));
  const at = clamp(highestOf(fine), 1, fine.length - 2);
  const [left, middle, right] = fine.slice(at - 1, at + 2);
  const bend = left - 2 * middle + right;
  const step = bend < 0 ? (0.5 * (left - right)) / bend : 0;
  return top + clamp((at + step) / (fine.length - 1) - 0.5, -0.5, 0.5);
}
