// The panel of a component: created once on its element, given the data of each run, closed at the end; drags and keys.

import { within } from "./dom.js";
import { html, live, render, svg } from "./lit_html.js";
import { filled, shortened } from "./numbers.js";

const panels = new WeakMap();

export class Panel {
  gone = new AbortController();
  /** @type {any} */
  layout = { width: 0, height: 0 }; // of its drawing, if it has one
  data;
  view; // the markup
  /** @type {(name: string, value: any) => void} */
  trigger; // tells Python about an event
  /** @type {(name: string, value: any) => void} */
  setState; // tells Python a value that stays

  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.findAll = (selector) => [...parent.querySelectorAll(selector)];
  }

  // Shows a run of the page on a component's element, and returns what closes the panel.
  static show({ data, parentElement, setTriggerValue, setStateValue }, view) {
    const panel = panels.get(parentElement) ?? new this(parentElement);
    panels.set(parentElement, panel);
    Object.assign(panel, { trigger: setTriggerValue, setState: setStateValue, view });
    panel.load(data);
    return () => {
      panel.gone.abort();
      panels.delete(parentElement);
    };
  }

  // Registers an action for when the panel is closed.
  atEnd(act) {
    this.gone.signal.addEventListener("abort", act);
  }

  // Listens to an event of the window until the panel is closed, even if an element stops its propagation.
  listen(type, react) {
    window.addEventListener(type, react, { signal: this.gone.signal, capture: true });
  }

  // Takes the data of a run; if they are unchanged, everything stays as the visitor left it.
  load(data) {
    const text = JSON.stringify(data);
    if (text === this.loaded) return;
    this.loaded = text;
    this.data = data;
    this.begin(data);
    if (!this.view) return; // there is no markup
    this.render();
    this.draw();
  }

  begin(_) {}

  // Renders the markup, or updates it.
  render() {
    render(this.view(this, this.data, this.data.words, TOOLS), this.find(".view"));
    if (this.root) return;
    this.root = this.find(".view").firstElementChild;
    this.stage = this.find(".stage");
    const observer = new ResizeObserver(() => this.schedule());
    observer.observe(this.root);
    this.atEnd(() => observer.disconnect());
    this.setUp();
  }

  // To be overridden. Called once there is markup.
  setUp() {}

  // Changes the state, and renders it.
  set(state) {
    Object.assign(this, state);
    this.draw();
  }

  // At most once per frame, however often the pointer moves.
  schedule() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.draw();
    });
  }

  draw() {
    const width = this.find("svg")?.clientWidth;
    if (width) this.layout = { width, ...this.layOut(width) };
    this.render();
  }

  // To be overridden. The layout of the drawing for its width, px.
  /** @returns {any} */
  layOut(_) {}
}

// A listener for a pointer that goes down: `grab(event)` returns the functions `move` and `end` of a drag, or nothing to
// ignore the event. `end` is told whether the pointer was released, rather than cancelled.
export const drag = (grab) => (event) => {
  const target = event.currentTarget;
  const { move, end } = (!event.button && grab(event)) || {};
  if (!move) return;
  const over = new AbortController();
  target.setPointerCapture(event.pointerId);
  target.classList.add("dragging");
  target.addEventListener("pointermove", move, over);
  for (const type of ["pointerdown", "pointerup", "pointercancel"]) {
    target.addEventListener(type, () => {
      target.classList.remove("dragging");
      over.abort();
      if (type !== "pointerdown") end?.(type === "pointerup");
    }, over);
  }
};

// A listener for keys: `actions(event)` returns the action of each, or nothing.
export const keys = (actions) => (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const act = actions(event)?.[event.key];
  if (!act) return;
  act();
  event.preventDefault();
};

// Actions for the arrow keys: `move(down, right)` by one step, with Shift by `far`.
export function arrows({ shiftKey }, move, far = 10) {
  const step = shiftKey ? far : 1;
  return {
    ArrowUp: () => move(-step, 0),
    ArrowDown: () => move(step, 0),
    ArrowLeft: () => move(0, -step),
    ArrowRight: () => move(0, step),
  };
}

const TOOLS = { html, svg, live, filled, shortened, drag, keys, within }; // for the markup
