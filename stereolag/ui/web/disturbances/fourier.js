// Fourier transforms, and correlations computed with them that do not wrap around.

const factors = new Map();

// The cosines and sines for a length that is a power of two, and the bit-reversed order of its samples.
function factorsOf(size) {
  let kept = factors.get(size);
  if (kept) return kept;
  const half = size / 2;
  kept = { cos: new Float64Array(half), sin: new Float64Array(half), order: new Uint32Array(size) };
  for (let k = 0; k < half; k++) {
    kept.cos[k] = Math.cos((2 * Math.PI * k) / size);
    kept.sin[k] = -Math.sin((2 * Math.PI * k) / size);
  }
  for (let i = 1; i < size; i++) kept.order[i] = (kept.order[i >> 1] >> 1) | (i & 1 ? half : 0);
  factors.set(size, kept);
  return kept;
}

// Forward and in place; the length is a power of two. With `re` and `im` exchanged, the inverse times the length.
function transform(re, im) {
  const size = re.length;
  const { cos, sin, order } = factorsOf(size);
  for (let i = 0; i < size; i++) {
    const j = order[i];
    if (j <= i) continue;
    const [real, imaginary] = [re[i], im[i]];
    re[i] = re[j];
    im[i] = im[j];
    re[j] = real;
    im[j] = imaginary;
  }
  for (let half = 1; half < size; half *= 2) {
    const stride = size / (2 * half);
    for (let start = 0; start < size; start += 2 * half) {
      for (let k = 0; k < half; k++) {
        const c = cos[k * stride];
        const s = sin[k * stride];
        const low = start + k;
        const high = low + half;
        const real = re[high] * c - im[high] * s;
        const imaginary = re[high] * s + im[high] * c;
        re[high] = re[low] - real;
        im[high] = im[low] - imaginary;
        re[low] += real;
        im[low] += imaginary;
      }
    }
  }
}

const powerOfTwo = (least) => 2 ** Math.ceil(Math.log2(Math.max(least, 2)));

// sum(first[i] * second[i + lag]) at index `lag`, negative lags counted from the end; `reach` is the longest needed.
export function correlated(first, second, reach) {
  const size = powerOfTwo(Math.max(first.length, second.length) + reach + 1);
  const [re, im] = [new Float64Array(size), new Float64Array(size)];
  re.set(first);
  im.set(second);
  transform(re, im);
  const [real, imaginary] = [new Float64Array(size), new Float64Array(size)];
  for (let k = 0; k < size; k++) {
    const other = (size - k) % size;
    const ar = (re[k] + re[other]) / 2;
    const ai = (im[k] - im[other]) / 2;
    const br = (im[k] + im[other]) / 2;
    const bi = (re[other] - re[k]) / 2;
    real[k] = (ar * br + ai * bi) / size;
    imaginary[k] = (ar * bi - ai * br) / size;
  }
  transform(imaginary, real);
  return real;
}

// The transform of any length by Bluestein's algorithm, as a correlation with a chirp.
export function spectrumOf(re, im) {
  const length = re.length;
  const size = powerOfTwo(2 * length);
  const [cos, sin] = [new Float64Array(length), new Float64Array(length)];
  for (let k = 0; k < length; k++) {
    const angle = (Math.PI * ((k * k) % (2 * length))) / length; // remainder first: large angles lose precision
    cos[k] = Math.cos(angle);
    sin[k] = Math.sin(angle);
  }
  const [ar, ai, br, bi] = Array.from({ length: 4 }, () => new Float64Array(size));
  for (let k = 0; k < length; k++) {
    ar[k] = re[k] * cos[k] + im[k] * sin[k];
    ai[k] = im[k] * cos[k] - re[k] * sin[k];
    br[k] = cos[k];
    bi[k] = sin[k];
    if (!k) continue;
    br[size - k] = cos[k];
    bi[size - k] = sin[k];
  }
  transform(ar, ai);
  transform(br, bi);
  for (let k = 0; k < size; k++) {
    const real = (ar[k] * br[k] - ai[k] * bi[k]) / size;
    ai[k] = (ar[k] * bi[k] + ai[k] * br[k]) / size;
    ar[k] = real;
  }
  transform(ai, ar);
  const found = { re: new Float64Array(length), im: new Float64Array(length) };
  for (let k = 0; k < length; k++) {
    found.re[k] = ar[k] * cos[k] + ai[k] * sin[k];
    found.im[k] = ai[k] * cos[k] - ar[k] * sin[k];
  }
  return found;
}
