// The arrows of a cross-spectrum, turned back by a lag, without server requests.

import { element } from "../shared/dom.js";
import { shortened } from "../shared/numbers.js";
import { onDrag, onKey, show } from "../shared/panel.js";
import { VisitingPanel } from "../shared/visiting.js";
import { highestReaches, lagAt, measuredChains, placeOf, PLACES_A_SAMPLE, placesOf } from "./chain.js";
import { drawChain, drawMagnitudes, drawPhases, drawReaches } from "./charts.js";

export default (component) => show(PhasorPanel, component);

class PhasorPanel extends VisitingPanel {
  constructor(parent) {
    super(parent);
    this.slider = this.find(".lag");
    this.slider.addEventListener("input", () => this.go(this.slider.valueAsNumber));
    this.find(".whiten").addEventListener("change", () => this.measure());
    // Home and End skip the lags between, as a click elsewhere does; the slider itself handles the other keys.
    onKey(this.slider, () => ({
      Home: () => this.go(-this.example.longest, { jump: true }),
      End: () => this.go(this.example.longest, { jump: true }),
      " ": () => this.toggle(),
    }));
    for (const name of ["phases", "lags"]) onDrag(this.find(`.${name}`), (event) => this.grab(event, name));
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
      this.find(`.caption-${name}`).replaceChildren(element("strong", "", title), `: ${text}`);
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

  go(lag, how = {}) {
    this.pause();
    this.move(placeOf(lag, this.example), how);
  }

  grab(event, name) {
    if (!this.lagOf) return null;
    event.preventDefault(); // do not select text
    this.slider.focus({ preventScroll: true });
    const drawing = event.currentTarget;
    const lag = ({ clientX, clientY }) => {
      const { left, top } = drawing.getBoundingClientRect();
      return this.lagOf[name](clientX - left, clientY - top);
    };
    this.go(lag(event), { jump: true });
    return { move: (moved) => this.go(lag(moved)) };
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
