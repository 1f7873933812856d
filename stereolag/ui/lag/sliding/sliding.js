// A cut of recording 1, dragged over recording 2 without server requests.

const PAGE = 10;

export default function (component) {
  return shown(SlidingPanel, component);
}

class SlidingPanel extends VisitingPanel {
  constructor(parent) {
    super(parent);
    this.stage = this.find(".stage");
    this.svg = this.find("svg");
    this.find(".normalise").addEventListener("change", () => this.measure());
    this.stage.addEventListener("keydown", (event) => this.type(event));
    this.stage.addEventListener("pointerdown", (event) => this.grab(event));
    this.stage.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) this.stage.addEventListener(name, () => this.release());
  }

  places() {
    return this.example.recording.length - this.example.cut.length + 1;
  }

  prepare() {
    this.stage.setAttribute("aria-valuemin", this.example.lag);
    this.stage.setAttribute("aria-valuemax", this.example.lag + (this.places() - 1) * this.example.step);
    this.find(".normalise").checked = false;
  }

  measure() {
    this.normalised = this.find(".normalise").checked;
    this.all = measured(this.example, this.normalised);
    this.schedule();
  }

  best() {
    return highest(this.all)[0];
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

  draw() {
    if (!this.all || !this.svg.clientWidth) return;
    const { words } = this.data;
    const { example, all, place, visited } = this;
    const named = { ...words, ...(this.normalised ? words.normalised : words.plain) };
    this.at = drawStrips(this.svg, example, all, { place, visited, words: named });
    const sum = shortened(all.sums[place], this.normalised ? 2 : example.whole ? 0 : 1);
    const lag = example.lag + place * example.step;
    const said = `${words.lag} ${shortened(lag, 0)} · ${named.sum} ${sum}`;
    this.stage.setAttribute("aria-valuenow", lag);
    this.stage.setAttribute("aria-valuetext", said);
    this.tell(said, example.said[this.normalised ? "normalised" : "plain"]);
  }
}
