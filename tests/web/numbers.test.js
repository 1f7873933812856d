import assert from "node:assert/strict";
import { test } from "node:test";

import { filled, shortened, ticks } from "../../stereolag/ui/web/shared/numbers.js";

test("a number that is none is a dash", () => {
  assert.equal(shortened(NaN, 2, "px"), "–");
});

test("a text is filled by name", () => {
  assert.equal(filled("Row {row}, column {col}: {score}", { row: 3, col: 4, score: "1.000" }), "Row 3, column 4: 1.000");
});

test("ticks are round, in the range, and as far apart as asked", () => {
  assert.deepEqual(ticks(-12, 12, 1.6), [-12, -10, -8, -6, -4, -2, 0, 2, 4, 6, 8, 10, 12]);
  assert.deepEqual(ticks(-1500, 1500, 240).map((tick) => tick / 500), [-3, -2, -1, 0, 1, 2, 3]);
  assert.deepEqual(ticks(0, 3, 0.1), [0, 1, 2, 3]); // lags are whole
});
