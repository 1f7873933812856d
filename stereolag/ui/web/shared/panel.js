// The panel of a component: created once on its element, given the data of each run, closed at the end. Drags and keys.

const panels = new WeakMap();

export function show(PanelOfComponent, { data, parentElement, setTriggerValue, setStateValue }) {
  let panel = panels.get(parentElement);
  if (!panel) panels.set(parentElement, (panel = new PanelOfComponent(parentElement)));
  Object.assign(panel, { trigger: setTriggerValue, setState: setStateValue });
  panel.load(data);
  return () => {
    panel.close();
    panels.delete(parentElement);
  };
}

export class Panel {
  constructor(parent, name) {
    /** @type {(selector: string) => any} */
    this.find = (selector) => parent.querySelector(selector);
    /** @type {(selector: string) => any[]} */
    this.findAll = (selector) => [...parent.querySelectorAll(selector)];
    this.root = this.find(`.${name}`);
    this.stage = this.find(".stage");
    this.gone = new AbortController();
    /** @type {(name: string, value: any) => void} */
    this.trigger = () => {}; // tells Python once
    /** @type {(name: string, value: any) => void} */
    this.setState = () => {}; // tells Python what holds from now on
  }

  close() {
    this.gone.abort();
  }

  // Listens to an event of the window, also one that an element keeps to itself, until the panel is closed.
  listen(type, react) {
    window.addEventListener(type, react, { signal: this.gone.signal, capture: true });
  }

  // Draws again whenever an element gets another size.
  watchSize(one, draw = () => this.schedule()) {
    const observer = new ResizeObserver(draw);
    observer.observe(one);
    this.gone.signal.addEventListener("abort", () => observer.disconnect());
  }

  // Takes the data of a run; if they are as before, everything stays as the visitor left it.
  load(data) {
    const text = JSON.stringify(data);
    if (text === this.loaded) return;
    this.loaded = text;
    /** @type {any} */
    this.data = data;
    this.begin(data);
  }

  begin(_) {}

  // Sets colours as custom properties of the same names.
  colour(colours) {
    for (const [name, colour] of Object.entries(colours)) this.root.style.setProperty(`--${name}`, colour);
  }

  // At most once per frame, however often the pointer moves.
  schedule() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.draw();
    });
  }

  draw() {}
}

// Calls `grab(event)` when a pointer goes down: it returns the functions `move` and `end` of a drag, or nothing to leave
// the event alone. `end` is told whether the pointer was released, and not taken away.
export function onDrag(target, grab) {
  let drag;
  target.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    drag = grab(event);
    if (!drag) return;
    target.setPointerCapture(event.pointerId);
    target.classList.add("dragging");
  });
  target.addEventListener("pointermove", (event) => drag?.move(event));
  for (const type of ["pointerup", "pointercancel"]) {
    target.addEventListener(type, () => {
      target.classList.remove("dragging");
      const { end } = drag ?? {};
      drag = undefined;
      end?.(type === "pointerup");
    });
  }
}

// Calls the action of a pressed key; `actions(event)` returns all of them by their keys.
export function onKey(target, actions) {
  target.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = actions(event)?.[event.key];
    if (!act) return;
    act();
    event.preventDefault();
  });
}

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
