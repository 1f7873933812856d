// The agreement of two recordings at a lag in excess of chance, as measured by `signals/whitening.py`. For recordings
// of up to 65,536 samples: of longer ones the library takes the loudest stretch.

import { partsAt } from "./curve.js";
import { correlated } from "./fourier.js";
import { dot, sumOf } from "./statistics.js";

const WHITENING = { order: 16, floor: 1e-4, memory: 256, runs: 64, longestRun: 1024 };

// Pearson's autocorrelation for lags from 0 to `reach`.
function autocorrelation(given, reach) {
  const energy = dot(given, given);
  const products = (lag) => dot(given.subarray(0, given.length - lag), given.subarray(lag));
  return Float64Array.from({ length: reach + 1 }, (_, lag) => (energy > 0 ? products(lag) / energy : 0));
}

// The filter that leaves the part of each sample not predicted by those before it (Levinson-Durbin recursion).
function predictionError(correlation, order) {
  let taps = [1];
  let error = correlation[0];
  for (let k = 1; k <= order; k++) {
    const missed = taps.reduce((sum, tap, i) => sum + tap * correlation[k - i], 0);
    const reflection = -missed / error;
    const longer = [...taps, 0];
    taps = longer.map((tap, i) => tap + reflection * longer[k - i]);
    error *= 1 - reflection * reflection;
  }
  return taps;
}

function filtered(given, taps) {
  const found = new Float64Array(given.length);
  for (let i = taps.length - 1; i < given.length; i++) {
    let sum = 0;
    for (let k = 0; k < taps.length; k++) sum += taps[k] * given[i - k];
    found[i] = sum;
  }
  const mean = sumOf(found) / found.length;
  return found.map((value) => value - mean);
}

export function whitePair(signal1, signal2) {
  const [one, other] = [signal1, signal2].map((given) => autocorrelation(given, WHITENING.order));
  const mean = one.map((value, lag) => (value + other[lag]) / 2);
  mean[0] *= 1 + WHITENING.floor;
  const taps = predictionError(mean, WHITENING.order);
  const [first, second] = [signal1, signal2].map((given) => filtered(given, taps));
  const [left1, left2] = [first, second].map((given) => autocorrelation(given, WHITENING.memory));
  return { first, second, colour: Math.sqrt(Math.max(1, 1 + 2 * (dot(left1, left2) - left1[0] * left2[0]))) };
}

// The score, the agreement in standard deviations of chance, and the agreement that could be reached.
export function agreementAt({ first, second, colour }, lag) {
  const [one, other] = partsAt(first, second, lag);
  const energy = Math.sqrt(dot(one, one) * dot(other, other));
  const products = new Float64Array(one.length);
  let [total, carried] = [0, 0];
  for (let i = 0; i < one.length; i++) {
    products[i] = one[i] * other[i];
    total += products[i];
    carried += Math.abs(products[i]);
  }
  let deviation = Math.sqrt(dot(products, products));
  if (!(energy > 0 && deviation > 0)) return { lag, score: 0, height: 0, reachable: 0 };
  const together = Math.floor(Math.min(WHITENING.longestRun, (carried / deviation) ** 2 / WHITENING.runs));
  if (together > 1) {
    const sums = [];
    for (let start = 0; start < products.length; start += together) sums.push(sumOf(products.subarray(start, start + together)));
    deviation = Math.max(deviation, Math.sqrt(dot(sums, sums) - total ** 2 / sums.length));
  }
  deviation *= colour;
  return { lag, score: total / energy, height: total / deviation, reachable: carried / deviation };
}

export function bestAgreement(pair, lag) {
  const [first, last] = [1 - pair.first.length, pair.second.length - 1];
  const near = [lag - 1, lag, lag + 1].filter((each) => each >= first && each <= last);
  return near.map((each) => agreementAt(pair, each)).reduce((best, one) => (one.height > best.height ? one : best));
}

// The mean product of two equally long parts for lags from -reach to reach, relative to perfect agreement.
export function localCurve(one, other, reach) {
  const products = correlated(one, other, reach);
  const energy = Math.sqrt(dot(one, one) * dot(other, other)) || 1;
  return Float64Array.from({ length: 2 * reach + 1 }, (_, index) => {
    const lag = index - reach;
    const product = products[lag < 0 ? products.length + lag : lag];
    return ((product / energy) * one.length) / (one.length - Math.abs(lag));
  });
}
