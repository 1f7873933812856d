// Other lags that fit as well because the recordings repeat, as found by `signals/rivals.py`.

import { overlapLength, partsAt, pearsonAt, topsOf } from "./curve.js";
import { spectrumOf } from "./fourier.js";
import { fittedLine, highestOf, median, medianSlope, sumOf } from "./statistics.js";
import { agreementAt, bestAgreement, localCurve } from "./whitening.js";

const RIVALS = { share: 0.85, reach: 2 ** 14, most: 16, lines: 8, lineShare: 0.7, fewestPeriods: 8, faint: 0.05 };
const REGULAR = 0.75;
const TEETH_SHARE = 0.5;

const nearestFirst = (found, lag) =>
  [...found].filter((other) => other !== lag).sort((a, b) => Math.abs(a - lag) - Math.abs(b - lag) || a - b).slice(0, RIVALS.most);

export function rivalsOf(first, second, pair, agreement, reach, needed, curve) {
  const nearby = repetitions(pair, agreement.lag, reach, needed);
  if (agreement.height >= needed) {
    for (const other of highPoints(pair, agreement.lag, curve, reach)) {
      const there = bestAgreement(pair, other);
      if (there.score >= RIVALS.share * agreement.score && there.height >= needed) nearby.add(there.lag);
    }
  }
  const least = RIVALS.share * pearsonAt(first, second, agreement.lag);
  return nearestFirst(nearby, agreement.lag).filter((other) => pearsonAt(first, second, other) >= least);
}

// The lags around `lag` at which the common part of both fits as well as at its best lag.
function repetitions(pair, lag, longest, needed) {
  const [one, other] = partsAt(pair.first, pair.second, lag);
  const reach = Math.min(RIVALS.reach, one.length >> 1);
  const skipped = Math.max(0, reach - longest - lag);
  const curve = localCurve(one, other, reach).slice(skipped, Math.max(0, longest - lag + reach) + 1);
  const start = lag - reach + skipped;
  const best = highestOf(curve);
  if (agreementAt(pair, start + best).height < needed) return new Set();
  const tops = topsOf(curve, best, RIVALS.share * curve[best]);
  return new Set(tops.length ? [...tops, best].map((top) => start + top) : []);
}

function highPoints({ first, second }, lag, curve, reach) {
  const peak = lag + reach;
  if (peak >= curve.length) return [];
  const overlap = (index) => overlapLength(first, second, index - reach);
  return topsOf(curve, peak, 0.6 * curve[peak])
    .filter((top) => overlap(top) >= 0.25 * overlap(peak))
    .sort((a, b) => curve[b] - curve[a] || a - b)
    .slice(0, RIVALS.most)
    .map((top) => top - reach);
}

// The teeth of a tone: a few lines of the curve's spectrum contain most of its power, and rebuild it without the noise.
export function toneRivals(first, second, lag, longest) {
  const [one, other] = partsAt(first, second, lag);
  const reach = Math.min(RIVALS.reach, one.length >> 1);
  const count = Math.min(RIVALS.lines, Math.floor(reach / 64));
  if (!count) return [];
  const curve = localCurve(one, other, reach);
  const size = curve.length;
  const bell = curve.map((_, i) => 0.5 - 0.5 * Math.cos((2 * Math.PI * i) / (size - 1)));
  const { re, im } = spectrumOf(curve.map((value, i) => value * bell[i]), new Float64Array(size));
  const power = re.slice(0, reach + 1).map((value, k) => value * value + im[k] * im[k]);
  const held = linesOf(power, count);
  if (!held) return [];
  for (let k = 0; k < size; k++) if (!held.has(Math.min(k, size - k))) re[k] = im[k] = 0;
  const { im: back } = spectrumOf(im, re);
  const middle = reach >> 1;
  const clean = back.map((value, i) => value / size / Math.max(bell[i], 0.1)).slice(middle, size - middle);
  const best = highestOf(clean);
  const tops = topsOf(clean, best, RIVALS.share * clean[best]);
  const apart = median(tops.slice(1).map((top, i) => top - tops[i]));
  if (tops.length < 2 || tops.length * apart < TEETH_SHARE * clean.length) return [];
  const found = new Set([best, ...tops].map((top) => lag - reach + middle + top));
  return nearestFirst([...found].filter((each) => Math.abs(each) <= longest), lag);
}

function linesOf(power, count) {
  const left = power.slice();
  left.fill(0, 0, 2 * RIVALS.fewestPeriods);
  const held = new Set();
  let strongest = 0;
  for (let i = 0; i < count; i++) {
    const line = highestOf(left);
    if (left[line] < RIVALS.faint * strongest) break;
    for (let k = Math.max(0, line - 2); k <= Math.min(line + 2, power.length - 1); k++) {
      held.add(k);
      strongest = Math.max(strongest, power[k]);
      left[k] = 0;
    }
  }
  const holding = [...held].reduce((sum, k) => sum + power[k], 0);
  return holding < RIVALS.lineShare * sumOf(power) ? undefined : held;
}

// The distance between neighbouring rivals if it is regular, within a sample or 2 %; otherwise null.
export function regularSpacing(rivals, lag) {
  if (rivals.length < 2) return null;
  const places = [...new Set([...rivals, lag])].sort((a, b) => a - b);
  const apart = median(places.slice(1).map((place, i) => place - places[i]));
  const numbers = places.map((place) => roundedToEven((place - rivals[0]) / apart));
  if (new Set(numbers).size < 3) return null;
  const spacing = medianSlope(numbers, places);
  const away = places.map((place, i) => place - spacing * numbers[i]);
  const usual = median(away);
  const regular = away.flatMap((value, i) => (Math.abs(value - usual) <= Math.max(1, 0.02 * apart) ? [i] : []));
  if (regular.length / away.length < REGULAR) return null;
  const kept = regular.map((i) => numbers[i]);
  if (new Set(kept).size < 3) return null;
  return fittedLine(kept, regular.map((i) => places[i])).slope;
}

function roundedToEven(value) {
  const rounded = Math.round(value);
  return Math.abs(value % 1) === 0.5 && rounded % 2 ? rounded - 1 : rounded;
}
