// Sums, medians and lines through points.

// Plain loops: `reduce` takes ten times as long.
export function sumOf(values) {
  let sum = 0;
  for (let i = 0; i < values.length; i++) sum += values[i];
  return sum;
}

export function dot(first, second) {
  let sum = 0;
  for (let i = 0; i < first.length; i++) sum += first[i] * second[i];
  return sum;
}

export function median(values) {
  const sorted = Float64Array.from(values).sort();
  const middle = sorted.length >> 1;
  return sorted.length % 2 ? sorted[middle] : (sorted[middle - 1] + sorted[middle]) / 2;
}

// The standard deviation estimated from the median absolute deviation.
export function robustDeviation(values, middle = median(values)) {
  return 1.4826 * median(values.map((value) => Math.abs(value - middle)));
}

export function highestOf(values) {
  let best = 0;
  for (let i = 1; i < values.length; i++) if (values[i] > values[best]) best = i;
  return best;
}

// The median of the slopes between all pairs of points (Theil-Sen).
export function medianSlope(x, y) {
  const slopes = x.flatMap((one, i) => x.slice(i + 1).flatMap((other, j) => (other === one ? [] : [(y[i + 1 + j] - y[i]) / (other - one)])));
  return median(slopes);
}

// Least squares: slope, intercept and the standard error of the slope.
export function fittedLine(x, y) {
  const [meanX, meanY] = [sumOf(x) / x.length, sumOf(y) / y.length];
  const [dx, dy] = [x.map((value) => value - meanX), y.map((value) => value - meanY)];
  const slope = dot(dx, dy) / dot(dx, dx);
  const missed = Math.max(0, dot(dy, dy) - slope * dot(dx, dy));
  return { slope, intercept: meanY - slope * meanX, error: Math.sqrt(missed / (x.length - 2) / dot(dx, dx)) };
}
