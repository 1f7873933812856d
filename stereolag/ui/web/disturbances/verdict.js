// The verdict on a lag: the rule of `signals/verdict.py` for the method "fft".

import { correlationCurve, normalised, peakOf } from "./curve.js";
import { driftOf } from "./drift.js";
import { regularSpacing, rivalsOf, toneRivals } from "./rivals.js";
import { highestOf, median, robustDeviation } from "./statistics.js";
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
