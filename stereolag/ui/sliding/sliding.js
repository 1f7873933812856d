// A cut of recording 1 that is dragged over recording 2, with nothing asked of the server.

const PLACES_A_SECOND = 50;
const PAGE = 10;
const panels = new WeakMap();

export default function ({ data, parentElement }) {
  let panel = panels.get(parentElement);
  if (!panel) panels.set(parentElement, (panel = new Panel(parentElement)));
  panel.load(data);
  return () => {
    panel.close();
    panels.delete(parentElement);
  };
}

class Panel {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.root = this.find(".sliding");
    this.stage = this.find(".stage");
    this.svg = this.find("svg");
    this.find(".play").addEventListener("click", () => this.toggle());
    this.find(".clear").addEventListener("click", () => this.clear());
    this.find(".normalise").addEventListener("change", () => this.measure());
    this.stage.addEventListener("keydown", (event) => this.type(event));
    this.stage.addEventListener("pointerdown", (event) => this.grab(event));
    this.stage.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) this.stage.addEventListener(name, () => this.release());
    this.resized = new ResizeObserver(() => this.schedule());
    this.resized.observe(this.stage);
  }

  close() {
    this.resized.disconnect();
    this.pause();
  }

  load(data) {
    const text = JSON.stringify(data);
    if (text === this.loaded) return; // the page ran again: what has been painted stays
    this.loaded = text;
    this.data = data;
    for (const [name, colour] of Object.entries(data.colours)) this.root.style.setProperty(`--${name}`, colour);
    this.find(".examples").replaceChildren(...data.examples.map((example) => this.button(example)));
    this.choose(data.examples[0]);
  }

  button(example) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: example.title });
    button.dataset.name = example.name;
    button.addEventListener("click", () => this.choose(example));
    return button;
  }

  choose(example) {
    this.example = example;
    for (const button of this.find(".examples").children) {
      button.setAttribute("aria-pressed", button.dataset.name === example.name);
    }
    this.find(".try").textContent = example.try;
    this.stage.setAttribute("aria-valuemin", example.lag);
    this.stage.setAttribute("aria-valuemax", example.lag + (example.recording.length - example.cut.length) * example.step);
    this.find(".normalise").checked = false;
    this.clear();
  }

  clear() {
    this.pause();
    this.place = 0;
    this.visited = new Array(this.example.recording.length - this.example.cut.length + 1).fill(false);
    this.visited[0] = true;
    this.measure();
  }

  measure() {
    this.normalised = this.find(".normalise").checked;
    this.all = measured(this.example, this.normalised);
    this.schedule();
  }

  // Moves the cut, and paints every place on its way; `jump` leaves those out that it did not slide over.
  move(place, { jump = false } = {}) {
    const to = clamp(Math.round(place), 0, this.visited.length - 1);
    const [first, last] = jump ? [to, to] : [Math.min(this.place, to), Math.max(this.place, to)];
    this.visited.fill(true, first, last + 1);
    this.place = to;
    this.schedule();
  }

  grab(event) {
    if (event.button || !this.at) return;
    this.pause();
    const sample = this.sampleAt(event);
    const length = this.example.cut.length;
    if (sample < this.place || sample >= this.place + length) this.move(sample - length / 2, { jump: true });
    this.held = sample - this.place;
    this.stage.setPointerCapture(event.pointerId);
    this.stage.classList.add("dragging");
  }

  drag(event) {
    if (this.held !== undefined) this.move(this.sampleAt(event) - this.held);
  }

  release() {
    this.held = undefined;
    this.stage.classList.remove("dragging");
  }

  sampleAt(event) {
    return (event.clientX - this.svg.getBoundingClientRect().left - LEFT) / this.at.pitch;
  }

  type(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const far = event.shiftKey ? PAGE : 1;
    const steps = { ArrowLeft: -far, ArrowDown: -far, ArrowRight: far, ArrowUp: far, PageDown: -PAGE, PageUp: PAGE };
    const ends = { Home: 0, End: this.visited.length - 1 };
    if (event.key === " ") this.toggle();
    else if (event.key in steps || event.key in ends) {
      this.pause();
      this.move(ends[event.key] ?? this.place + steps[event.key], { jump: event.key in ends });
    } else return;
    event.preventDefault();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  // Slides over every place from the first on, and comes to rest at the highest.
  play() {
    const last = this.visited.length - 1;
    if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.place = 0;
      this.move(last);
      this.move(highest(this.all)[0]);
      return;
    }
    this.place = 0;
    const begun = performance.now();
    const go = (now) => {
      this.move(((now - begun) / 1000) * Math.min(PLACES_A_SECOND, this.visited.length / 3));
      if (this.place < last) this.playing = requestAnimationFrame(go);
      else {
        this.pause();
        this.move(highest(this.all)[0]);
      }
    };
    this.playing = requestAnimationFrame(go);
    this.showState();
  }

  pause() {
    cancelAnimationFrame(this.playing);
    this.playing = undefined;
    this.showState();
  }

  showState() {
    this.find(".play").textContent = this.playing ? "❚❚ Pause" : "▶ Play";
  }

  // Once a frame at most, however many times the pointer moves.
  schedule() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.draw();
    });
  }

  draw() {
    if (!this.all || !this.svg.clientWidth) return;
    const { words } = this.data;
    const { example, all, place, visited } = this;
    const named = { ...words, ...(this.normalised ? words.normalised : words.plain) };
    this.at = drawStrips(this.svg, example, all, { place, visited, words: named });
    const sum = shortened(all.sums[place], this.normalised ? 2 : example.whole ? 0 : 1);
    const lag = example.lag + place * example.step;
    const said = `${words.lag} ${shortened(lag, 0)} · ${named.sum} ${sum}`;
    this.find(".where").textContent = said;
    this.stage.setAttribute("aria-valuenow", lag);
    this.stage.setAttribute("aria-valuetext", said);
    const finished = visited.every(Boolean) && !this.playing;
    const lesson = finished ? example.said[this.normalised ? "normalised" : "plain"] : "";
    if (lesson !== this.find(".said").textContent) this.find(".said").textContent = lesson; // read aloud once
  }
}
