// Both images of a pair in grey and its ground truth, for the panel that follows the pointer.

import { codesOf, pixelsOf } from "../shared/packing.js";

const TRUTH_SCALE = 64;
const TRUTH_ZERO = 512;

// Unpacks the item of stereolag.ui.packing.packed_grey_pair.
export async function pairOf({ parts, rows, cols, digest }) {
  const [left, right, truth] = await Promise.all(parts.map(pixelsOf));
  const red = ({ data }) => Uint8Array.from({ length: rows * cols }, (_, at) => data[4 * at]);
  const codes = truth && codesOf(truth);
  return {
    digest,
    rows,
    cols,
    left: red(left),
    right: red(right),
    images: [left.image, right.image],
    deviation: deviation(red(left)),
    truth: (row, col) => {
      const code = codes ? codes[row * cols + col] : 0;
      return code ? code / TRUTH_SCALE - TRUTH_ZERO : NaN;
    },
  };
}

function deviation(values) {
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  return Math.sqrt(values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / values.length);
}
