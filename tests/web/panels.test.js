import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import dragged from "../../stereolag/ui/web/dragging/dragging.js";
import { joined } from "../../stereolag/ui/web/listening/pieces.js";
import { branch } from "../../stereolag/ui/web/shared/hyperbola.js";
import { measured } from "../../stereolag/ui/web/sliding/sliding.js";
import { gapped, runsOf } from "../../stereolag/ui/web/shared/dom.js";
import { eventOf, hold, received, release } from "../../stereolag/ui/web/shared/exchange.js";
import { codesOf, packed, scoresOf, unpacked } from "../../stereolag/ui/web/shared/packing.js";
import { arrows } from "../../stereolag/ui/web/shared/panel.js";

beforeEach(() => {
  /** @type {any} */ (globalThis).window = new EventTarget();
});

for (const difference of [-378, -40, 0, 120, 399]) {
  test(`every place of the curve has the path difference ${difference}`, () => {
    const places = branch(difference, 400, 800);
    for (const [x, y] of places) {
      assert.ok(Math.abs(Math.hypot(x - 200, y) - Math.hypot(x + 200, y) - difference) < 1e-6);
    }
    assert.ok(Math.max(...places.map(([x, y]) => Math.hypot(x, y))) > 800);
  });
}

test("silence has no correlation, and the highest place is found", () => {
  const all = measured({ cut: [1, -1], recording: [0.1, 0.1, 0.1, 2] }, true);
  assert.deepEqual(all.values.map(Math.round), [0, 0, -1]);
  assert.deepEqual(measured({ cut: [1, 2], recording: [1, 2, 1, 2] }, false).peaks, [0, 2]);
});

test("a curve has gaps, and a point alone is a dot", () => {
  assert.deepEqual(runsOf([true, true, false, true]), [[0, 1], [3]]);
  assert.equal(gapped(["0 0", "1 0", false, "3 0"]), "M0 0L1 0M3 0h0");
});

test("an item stays as long as somebody holds it, and each change is told", () => {
  const told = [];
  window.addEventListener(eventOf("marks"), ({ detail }) => told.push([detail.name, detail.before, detail.item]));
  const [first, second] = [{}, {}];
  hold("marks", "map", "a", first);
  hold("marks", "map", "a", second);
  hold("marks", "other", "b", first); // holds it no longer
  assert.equal(received("marks", "map"), "a");
  hold("marks", "other", "c", first); // changed
  release("marks", second);
  release("marks", second);
  assert.equal(received("marks", "map"), undefined);
  assert.equal(received("marks", "other"), "c");
  assert.deepEqual(told.slice(2), [["other", "map", "b"], ["other", "other", "c"], ["map", undefined, undefined]]);
});

test("an item is unpacked wherever its bytes lie", () => {
  const header = new TextEncoder().encode(JSON.stringify({ kind: "pair", parts: [[0, 2], [2, 3]] }));
  const data = new Uint8Array(5 + 4 + header.length + 5).subarray(5);
  data[0] = header.length;
  data.set(header, 4);
  data.set([1, 2, 3, 4, 5], 4 + header.length);
  const { kind, parts } = unpacked(data);
  assert.equal(kind, "pair");
  assert.deepEqual(parts.map((part) => [...part]), [[1, 2], [3, 4, 5]]);
});

test("codes of 16 bits are red and green, and a score without a code is none", () => {
  const picture = { rows: 1, cols: 3, data: [0, 0, 0, 255, 0, 1, 0, 255, 117, 49, 0, 255] };
  assert.deepEqual([...codesOf(picture)], [0, 1, 30001]);
  assert.deepEqual([...scoresOf(picture, 30_000).scores], [NaN, -1, 0]);
});

test("arrow keys move by one, with Shift by ten", () => {
  const moves = [];
  const move = (down, right) => moves.push([down, right]);
  arrows({ shiftKey: false }, move).ArrowUp();
  arrows({ shiftKey: true }, move).ArrowRight();
  assert.deepEqual(moves, [[-1, 0], [0, 10]]);
});

test("blocks of sound are joined, and the oldest samples left out", () => {
  const blocks = [[[1, 2], [-1, -2]], [[3, 4], [-3, -4]]].map((both) => both.map((one) => Int16Array.from(one)));
  assert.deepEqual(joined(blocks, 3).map(({ buffer }) => [...new Int16Array(buffer)]), [[2, 3, 4], [-2, -3, -4]]);
  assert.deepEqual(joined([], 3).map(({ length }) => length), [0, 0]);
});

test("a dragged place without an answer is asked for again, and a released slider without a map is told once more", () => {
  mock.timers.enable({ apis: ["setInterval", "setTimeout", "Date"] });
  const handle = { value: "21" };
  const box = { classList: ["st-key-depth-zncc-window_size"], querySelector: () => handle };
  Object.assign(window, { closest: () => box });
  const told = [];
  const shown = (data) =>
    dragged({ data, parentElement, setTriggerValue: (...one) => told.push(one), setStateValue: () => {} });
  const parentElement = { querySelector: () => null, querySelectorAll: () => [] };
  const close = shown(null);
  const dragTo = (value) => {
    window.dispatchEvent(new Event("pointerdown"));
    handle.value = value;
    mock.timers.tick(100);
  };
  const release = () => {
    window.dispatchEvent(new Event("pointerup"));
    mock.timers.tick(10_000);
  };
  const asked = (value) => ["at", { slider: "st-key-depth-zncc-window_size", value }];

  dragTo("25");
  assert.deepEqual(told.splice(0), [asked(25)]);
  mock.timers.tick(4000);
  assert.deepEqual(told.splice(0), [asked(25)]);
  shown(packed({ title: "map" }));
  mock.timers.tick(10_000);
  assert.deepEqual(told.splice(0), []);
  release();
  assert.deepEqual(told.splice(0), [["unheard", true]]);

  dragTo("29");
  window.dispatchEvent(new Event("pointerup"));
  hold("description", "map", {}, {});
  mock.timers.tick(10_000);
  assert.deepEqual(told.splice(0), [asked(29)]);

  dragTo("33");
  handle.value = "29"; // back at its start
  release();
  assert.deepEqual(told.splice(0), [asked(33)]);
  close();
  mock.timers.reset();
});
