import assert from "node:assert/strict";
import { test } from "node:test";

import { correlated, spectrumOf } from "../../stereolag/ui/web/disturbances/fourier.js";
import { topsOf } from "../../stereolag/ui/web/disturbances/curve.js";
import { fittedLine, median, medianSlope } from "../../stereolag/ui/web/disturbances/statistics.js";

const wave = (length, seed) => Float64Array.from({ length }, (_, i) => Math.sin(seed * (i + 1) ** 2));

const near = (found, expected, tolerance = 1e-9) => assert.ok(Math.abs(found - expected) < tolerance, `${found} is not ${expected}`);

for (const length of [2, 7, 96, 1001]) {
  test(`the spectrum of ${length} values is the sum that defines it`, () => {
    const [re, im] = [wave(length, 0.7), wave(length, 1.3)];
    const found = spectrumOf(re, im);
    for (const k of [0, 1, length >> 1, length - 1]) {
      let [real, imaginary] = [0, 0];
      for (let i = 0; i < length; i++) {
        const angle = (-2 * Math.PI * ((i * k) % length)) / length;
        real += re[i] * Math.cos(angle) - im[i] * Math.sin(angle);
        imaginary += re[i] * Math.sin(angle) + im[i] * Math.cos(angle);
      }
      near(found.re[k], real, 1e-9 * length);
      near(found.im[k], imaginary, 1e-9 * length);
    }
  });
}

test("a correlation does not wrap around", () => {
  const [first, second] = [wave(20, 0.7), wave(31, 1.3)];
  const products = correlated(first, second, 6);
  for (let lag = -6; lag <= 6; lag++) {
    const sum = first.reduce((total, value, i) => total + value * (second[i + lag] ?? 0), 0);
    near(products.at(lag), sum);
  }
});

test("tops lie outside the main lobe of the peak", () => {
  assert.deepEqual(topsOf([0, 0.7, 0.1, 0.6, 1, 0.9, 0.2, 0.8, 0, 0.3, 0], 4, 0.5), [1, 7]);
});

test("lines pass through their points, whatever a single one does", () => {
  const x = [0, 1, 2, 3, 4];
  const line = fittedLine(x, x.map((each) => 3 - 2 * each));
  near(line.slope, -2);
  near(line.intercept, 3);
  near(line.error, 0);
  near(medianSlope(x, [3, 1, -1, -3, 100]), -2);
  assert.equal(median([5, 1, 3, 2]), 2.5);
});
