// The verdict on a lag: the rule of `signals/verdict.py` for the method "fft".

import { correlationCurve, FINE, normalised, partsAt, peakOf, refinedPeak } from "./curve.js";
import { correlated } from "./fourier.js";
import { regularSpacing, rivalsOf, toneRivals } from "./rivals.js";
import { fittedLine, highestOf, median, medianSlope, robustDeviation } from "./statistics.js";
import { agreementAt, bestAgreement, whitePair } from "./whitening.js";

const MARGIN = 1.8;

export function judged(signal1, signal2, reach) {
  const [first, second] = [normalised(signal1), normalised(signal2)];
  const curve = correlationCurve(first, second, reach);
  const peak = peakOf(curve, first, second, reach);
  const lag = peak - reach;
  const chance = Math.sqrt(2 * Math.log(curve.length + 1));
  const needed = chance + MARGIN;
  const pair = whitePair(first, second);
  const agreement = bestAgreement(pair, lag);
  let rivals = rivalsOf(first, second, pair, agreement, reach, needed, curve);
  if (agreement.height < needed && !rivals.length) rivals = toneRivals(first, second, lag, reach);
  const drift = driftOf(pair, lag);
  const middle = median(curve);
  const deviation = robustDeviation(curve, middle);
  const opposite = oppositeOf(pair, agreement, curve, reach, needed);
  const [verdict, reason] = decided(agreement, rivals, needed, drift, opposite);
  if (verdict !== "ambiguous") rivals = [];
  return {
    verdict, reason, lag, rivals, curve, chance, needed,
    spacing: regularSpacing(rivals, lag),
    evidence: agreement.height,
    height: (curve[highestOf(curve)] - middle) / deviation,
    ribbon: [middle - chance * deviation, middle + chance * deviation],
    opposite,
    drift: verdict === "sure" ? drift : null,
  };
}

function decided(agreement, rivals, needed, drift, opposite) {
  if (rivals.length) return ["ambiguous", regularSpacing(rivals, agreement.lag) === null ? "rivals" : "repeats"];
  if (drift?.shows) return ["sure", "drift"];
  if (agreement.height >= needed) return ["sure", "clear"];
  if (opposite !== null) return ["nothing", "opposite_sign"];
  return ["nothing", agreement.reachable < needed ? "too_little" : "chance"];
}

// The lag at which recording 2 with its sign reversed agrees better; null if there is none.
function oppositeOf(pair, agreement, curve, reach, needed) {
  const lowest = highestOf(curve.map((value) => -value));
  if (-curve[lowest] <= 1.1 * curve[highestOf(curve)]) return null;
  const lag = lowest - reach;
  return -agreementAt(pair, lag).height >= Math.max(needed, agreement.height) ? lag : null;
}

// The drift of the lag, as measured by `signals/drift.py`: a straight line through the lags of blocks.

const DRIFT = { blocks: 16, shortest: 1024, longest: 2 ** 14, farthest: 300e-6, clear: 5.5, stray: 2, most: 0.6, fewest: 5 };

function driftOf({ first, second }, lag) {
  const [one, other] = partsAt(first, second, lag);
  const count = Math.min(DRIFT.blocks, Math.floor(one.length / DRIFT.shortest));
  if (count < DRIFT.fewest) return null;
  const whole = Math.floor(one.length / count);
  const length = Math.min(whole, DRIFT.longest);
  const reach = Math.round(Math.min(Math.max(Math.trunc(DRIFT.farthest * one.length), FINE.reach), length >> 2));
  const padded = new Float64Array(other.length + 2 * reach);
  padded.set(other, reach);
  const [places, lags] = [[], []];
  for (let block = 0; block < count; block++) {
    const start = block * whole + ((whole - length) >> 1);
    const products = correlated(one.subarray(start, start + length), padded.subarray(start, start + length + 2 * reach), 2 * reach);
    const curve = products.slice(0, 2 * reach + 1);
    const top = highestOf(curve);
    if (!(curve[top] > DRIFT.clear * robustDeviation(curve) && top > 0 && top < 2 * reach)) continue;
    places.push(start + length / 2);
    lags.push(lag + refinedPeak(curve, top) - reach);
  }
  const enough = Math.max(DRIFT.fewest, DRIFT.most * count);
  return places.length < enough ? null : lineOf(places, lags, one.length, enough);
}

function lineOf(places, lags, size, enough) {
  const rough = medianSlope(places, lags);
  const middle = median(lags) - rough * median(places);
  const near = lags.flatMap((lag, i) => (Math.abs(lag - middle - rough * places[i]) <= DRIFT.stray ? [i] : []));
  if (near.length < enough) return null;
  const { slope, intercept, error } = fittedLine(near.map((i) => places[i]), near.map((i) => lags[i]));
  const span = slope * size;
  const shows = Math.abs(span) >= 1 && Math.abs(slope) > 4 * error;
  return { start: intercept, ppm: 1e6 * slope, error_ppm: 1e6 * error, span, blocks: near.length, shows };
}
