// The cross-spectrum as arrows, one complex number per frequency, and the chain they form head to tail.

export const PLACES_A_SAMPLE = 4;

export const lagAt = (place, example) => place / PLACES_A_SAMPLE - example.longest;
export const placeOf = (lag, example) => Math.round((lag + example.longest) * PLACES_A_SAMPLE);
export const placesOf = (example) => 2 * example.longest * PLACES_A_SAMPLE + 1;

// The lengths of the arrows: the product of both magnitudes. Whitened (PHAT), they are equal and add up to 1; empty
// frequencies are left out.
function arrowLengths({ magnitude_1, magnitude_2 }, whiten) {
  const products = magnitude_1.map((magnitude, index) => magnitude * magnitude_2[index]);
  if (!whiten) return products;
  const heard = products.filter((product) => product > 0).length;
  return products.map((product) => (product > 0 ? 1 / heard : 0));
}

// The start of the chain and the tip of each arrow, as [x, y], y upwards: arrow k is turned back by k * lag / size,
// the share of a turn that frequency k makes in that time.
function chainAt({ turns, size }, lengths, lag) {
  let [x, y] = [0, 0];
  const points = [[x, y]];
  lengths.forEach((length, index) => {
    const angle = 2 * Math.PI * (((index + 1) * lag) / size - turns[index]);
    x += length * Math.cos(angle);
    y += length * Math.sin(angle);
    points.push([x, y]);
  });
  return points;
}

// Everything drawn for one example: the chain at each place, how far to the right it ends (the correlation),
// and how far it would reach with all arrows in line.
export function measuredChains(example, whiten) {
  const lengths = arrowLengths(example, whiten);
  const chains = Array.from({ length: placesOf(example) }, (_, place) => chainAt(example, lengths, lagAt(place, example)));
  const reaches = chains.map((points) => points.at(-1)[0]);
  const [xs, ys] = [0, 1].map((axis) => chains.flat().map((point) => point[axis]));
  const total = lengths.reduce((sum, length) => sum + length, 0);
  const bounds = { left: Math.min(...xs), right: Math.max(total, ...xs), bottom: Math.min(...ys), top: Math.max(...ys) };
  return { lengths, chains, reaches, total, bounds };
}

// The places of the highest correlation, several if it repeats, the smallest lag first.
export function highestReaches({ reaches }, example) {
  const top = Math.max(...reaches);
  const [before, after] = [-1, 1].map((step) => (place) => reaches[place + step] ?? -Infinity);
  const isPeak = (reach, place) => top - reach < 1e-3 && reach >= before(place) && reach >= after(place);
  const size = (place) => Math.abs(lagAt(place, example));
  return reaches.flatMap((reach, place) => (isPeak(reach, place) ? [place] : [])).sort((one, other) => size(one) - size(other));
}
