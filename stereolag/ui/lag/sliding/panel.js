// The common part of the panels of this page: examples to choose from, places to visit one after the other, and Play,
// which visits them all. A panel extends `VisitingPanel` and adds its measurement and drawing.

const PLACES_A_SECOND = 50;

class VisitingPanel {
  start = 0; // the place at which an example starts

  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.root = this.find(".panel");
    this.find(".play").addEventListener("click", () => this.toggle());
    this.find(".clear").addEventListener("click", () => this.clear());
    this.resized = new ResizeObserver(() => this.schedule());
    this.resized.observe(this.root);
  }

  close() {
    this.resized.disconnect();
    this.pause();
  }

  load(data) {
    const text = JSON.stringify(data);
    if (text === this.loaded) return; // the page ran again: the visited places stay
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
    this.prepare();
    this.clear();
  }

  clear() {
    this.pause();
    this.place = this.start;
    this.visited = new Array(this.places()).fill(false);
    this.visited[this.place] = true;
    this.measure();
  }

  // Moves to a place and visits every place on the way; `jump` skips the places between.
  move(place, { jump = false } = {}) {
    const to = clamp(Math.round(place), 0, this.visited.length - 1);
    const [first, last] = jump ? [to, to] : [Math.min(this.place, to), Math.max(this.place, to)];
    this.visited.fill(true, first, last + 1);
    this.place = to;
    this.schedule();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  // Visits every place from the first to the last, then returns to the highest.
  play() {
    const last = this.visited.length - 1;
    this.place = 0;
    if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.move(last);
      this.move(this.best());
      return;
    }
    const begun = performance.now();
    const go = (now) => {
      this.move(((now - begun) / 1000) * Math.min(PLACES_A_SECOND, this.visited.length / 3));
      if (this.place < last) this.playing = requestAnimationFrame(go);
      else {
        this.pause();
        this.move(this.best());
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

  // At most once per frame, however often the pointer moves.
  schedule() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.draw();
    });
  }

  // Shows the current place and, once every place has been visited, the example's lesson, which is read aloud once.
  tell(where, lesson) {
    this.find(".where").textContent = where;
    const said = this.visited.every(Boolean) && !this.playing ? lesson : "";
    if (said !== this.find(".said").textContent) this.find(".said").textContent = said;
  }
}
