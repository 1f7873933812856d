import assert from "node:assert/strict";
import { beforeEach, mock, test } from "node:test";

import sliders from "../../stereolag/ui/web/sliders/sliders.js";
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

for (const difference of [-0.95, -0.1, 0, 0.3, 0.999]) {
  test(`every place of the curve has the path difference ${difference}`, () => {
    const places = branch(difference);
    for (const [x, y] of places) {
      assert.ok(Math.abs(Math.hypot(x - 0.5, y) - Math.hypot(x + 0.5, y) - difference) < 1e-9);
    }
    assert.ok(Math.max(...places.map(([x, y]) => Math.hypot(x, y))) > 8);
  });
}

test("silence has no correlation, and the highest place is found", () => {
  const all = measured({ cut: [1, -1], recording: [0.1, 0.1, 0.1, 2] }, true);
  assert.deepEqual(all.values.map(Math.round), [0, 0, -1]);
  assert.deepEqual(measured({ cut: [1, 2], recording: [1, 2, 1, 2] }, false).peaks, [0, 2]);
});

test("a curve has gaps, and a point alone is a dot", () => {
  assert.deepEqual(runsOf([true, true, false, true]), [[0, 1], [3]]);
  assert.equal(gapped(["0 0", "1 0", false, "3 0"]), "M0 0h0L1 0M3 0h0");
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
  release(second);
  release(second);
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
  const blocks = [[[1, 2], [-1, -2]], [[3, 4], [-3, -4]]].map((both) => both.map((one) => Float32Array.from(one, (sample) => sample / 32768)));
  assert.deepEqual(joined(blocks, 3).map(({ buffer }) => [...new Int16Array(buffer)]), [[2, 3, 4], [-2, -3, -4]]);
  assert.deepEqual(joined([], 3).map(({ length }) => length), [0, 0]);
});

test("a slider that is dragged is asked for in small, and in whole once it is released or moved by a key", () => {
  mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const sockets = [];
  class Socket {
    static OPEN = 1;
    readyState = 1;
    sent = [];
    constructor() {
      sockets.push(this);
    }
    send(message) {
      this.sent.push(message);
    }
    close() {}
  }
  Object.assign(globalThis, { WebSocket: Socket });
  const handle = {
    value: "21",
    cloneNode: () => ({ value: handle.value, stepUp() { this.value = String(Number(this.value) + 2); } }),
  };
  const box = { classList: ["st-key-depth-zncc-window_size"], querySelector: () => handle };
  Object.assign(window, { closest: () => box, location: { protocol: "http:", host: "here" } });
  const previews = [];
  window.addEventListener(eventOf("preview"), ({ detail }) => previews.push(detail));
  const parentElement = { querySelector: () => null, querySelectorAll: () => [] };
  const data = { address: "/live", token: "t" };
  const close = sliders({ data, parentElement, setTriggerValue: () => {}, setStateValue: () => {} });
  const event = (type, more = {}) => window.dispatchEvent(Object.assign(new Event(type), more));
  const dragTo = (value) => {
    event("pointerdown");
    handle.value = value;
    mock.timers.tick(100);
  };
  const asked = () => sockets[0].sent.splice(0).map((one) => {
    const { slider, value, whole } = unpacked(one);
    assert.equal(slider, "st-key-depth-zncc-window_size");
    return [value, whole];
  });
  const answer = (parts = [packed({ kind: "pictures" })]) =>
    sockets[0].onmessage({ data: packed({ name: "maps", title: "map" }, parts).buffer });

  event("focusin");
  sockets[0].onopen();
  assert.deepEqual(sockets[0].sent.splice(0), ["t"]);
  dragTo("25");
  assert.deepEqual(asked(), [[25, false]]);
  handle.value = "27";
  mock.timers.tick(100);
  handle.value = "29";
  mock.timers.tick(100);
  assert.deepEqual(asked(), []); // one at a time
  answer();
  assert.equal(previews.splice(0)[0].title, "map");
  assert.deepEqual(asked(), [[29, false]]); // the latest
  event("pointerup");
  answer();
  assert.deepEqual(previews.splice(0), []); // too late
  assert.deepEqual(asked(), [[29, true]]);
  answer([]);
  assert.deepEqual(previews.splice(0), []); // it takes long: the page will bring it

  dragTo("33");
  asked();
  answer();
  handle.value = "29"; // back at its start
  event("pointerup");
  assert.deepEqual(asked(), []);
  assert.deepEqual(previews.splice(0).map(({ parts }) => parts.length), [0, 0]);

  event("keydown", { key: "ArrowRight" });
  assert.deepEqual(asked(), [[31, true]]); // before the slider has it
  handle.value = "31";
  mock.timers.tick(10);
  answer();
  assert.deepEqual(asked(), []);
  event("keydown", { key: "End" });
  assert.deepEqual(asked(), []);
  handle.value = "101";
  mock.timers.tick(10);
  assert.deepEqual(asked(), [[101, true]]);
  sockets[0].onclose();
  event("keydown", { key: "ArrowRight" });
  assert.equal(sockets.length, 2);
  close();
  mock.timers.reset();
});
