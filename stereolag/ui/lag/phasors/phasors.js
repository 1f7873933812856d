// The arrows of a cross-spectrum, turned back by a lag, without server requests.

export default function (component) {
  return shown(PhasorPanel, component);
}

class PhasorPanel extends VisitingPanel {
  constructor(parent) {
    super(parent);
    this.slider = this.find(".lag");
    this.slider.addEventListener("input", () => this.go(this.slider.valueAsNumber));
    this.slider.addEventListener("keydown", (event) => this.type(event));
    this.find(".whiten").addEventListener("change", () => this.measure());
    for (const name of ["phases", "lags"]) {
      const drawing = this.find(`.${name}`);
      drawing.addEventListener("pointerdown", (event) => this.grab(event, name));
      drawing.addEventListener("pointermove", (event) => this.drag(event, name));
      for (const end of ["pointerup", "pointercancel"]) drawing.addEventListener(end, () => (this.held = undefined));
    }
  }

  places() {
    return placesOf(this.example);
  }

  prepare() {
    const { longest } = this.example;
    this.start = placeOf(0, this.example);
    Object.assign(this.slider, { min: -longest, max: longest, step: 1 / PLACES_A_SAMPLE });
    this.find(".whiten").checked = false;
    for (const [name, [title, text]] of Object.entries(this.data.words.captions)) {
      const heading = Object.assign(document.createElement("strong"), { textContent: title });
      this.find(`.caption-${name}`).replaceChildren(heading, `: ${text}`);
    }
  }

  measure() {
    this.whitened = this.find(".whiten").checked;
    this.all = measuredChains(this.example, this.whitened);
    this.schedule();
  }

  best() {
    return highestReaches(this.all, this.example)[0];
  }

  go(lag, how) {
    this.pause();
    this.move(placeOf(lag, this.example), how);
  }

  // Home and End skip the lags between, as a click elsewhere does; the slider itself handles the other keys.
  type(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const ends = { Home: -this.example.longest, End: this.example.longest };
    if (event.key === " ") this.toggle();
    else if (event.key in ends) this.go(ends[event.key], { jump: true });
    else return;
    event.preventDefault();
  }

  grab(event, name) {
    if (event.button || !this.lagOf) return;
    event.preventDefault(); // do not select text
    this.slider.focus({ preventScroll: true });
    this.held = name;
    event.currentTarget.setPointerCapture(event.pointerId);
    this.go(this.under(event, name), { jump: true });
  }

  drag(event, name) {
    if (this.held === name) this.go(this.under(event, name));
  }

  under(event, name) {
    const { left, top } = event.currentTarget.getBoundingClientRect();
    return this.lagOf[name](event.clientX - left, event.clientY - top);
  }

  draw() {
    if (!this.all || !this.find(".lags").clientWidth) return;
    const { words } = this.data;
    const { example, all, place, visited, whitened } = this;
    const lag = lagAt(place, example);
    drawMagnitudes(this.find(".magnitudes"), example, { whiten: whitened, words });
    drawChain(this.find(".chain"), all, { place, words, count: example.turns.length });
    this.lagOf = {
      phases: drawPhases(this.find(".phases"), example, all, { lag, words }),
      lags: drawReaches(this.find(".lags"), example, all, { place, visited, words }),
    };
    const whole = (number) => shortened(number, Number.isInteger(number) ? 0 : 2);
    const there = example.excerpt ? ` (${whole(example.offset + lag * example.step)} ${words.there})` : "";
    const said = `${words.lag} ${whole(lag)}${there} · ${words[whitened ? "whitened" : "plain"]} ${shortened(all.reaches[place], 2)}`;
    this.slider.value = lag;
    this.slider.setAttribute("aria-valuetext", said);
    this.tell(said, example.said[whitened ? "whitened" : "plain"]);
  }
}
