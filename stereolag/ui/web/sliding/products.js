// The products at one place, and their sum.

// The products of the cut with the samples under it. Normalised, both are centred and divided by their length as
// vectors, so that the sum is Pearson's correlation; constant values give zeros.
function productsAt(recording, cut, place, normalise) {
  const under = recording.slice(place, place + cut.length);
  const [first, second] = normalise ? [standardised(cut), standardised(under)] : [cut, under];
  return first.map((value, index) => value * second[index]);
}

function standardised(values) {
  const mean = total(values) / values.length;
  const centred = values.map((value) => value - mean);
  const length = Math.hypot(...centred);
  return centred.map((value) => (length > 1e-9 ? value / length : 0));
}

function total(values) {
  return values.reduce((sum, value) => sum + value, 0);
}

// Everything drawn for one example: products and sum at each place, and the sum of a perfect match.
export function measured({ recording, cut }, normalise) {
  const places = recording.length - cut.length + 1;
  const products = Array.from({ length: places }, (_, place) => productsAt(recording, cut, place, normalise));
  const sums = products.map(total);
  const perfect = normalise ? 1 : total(cut.map((value) => value * value));
  const low = normalise ? -1 : Math.min(0, ...sums);
  const largest = Math.max(...products.flat().map(Math.abs));
  return { products, sums, perfect, low, high: Math.max(perfect, ...sums), largest };
}

// The places with the highest sum, several if it repeats.
export function highest({ sums, low, high }) {
  const top = Math.max(...sums);
  return sums.flatMap((sum, place) => (top - sum < 1e-3 * (high - low) ? [place] : []));
}
