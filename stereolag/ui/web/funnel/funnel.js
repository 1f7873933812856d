// The steps of the "sampled" search for any picked pixel of the template, without server requests.

import { button, described, element, node, shareOf, showPressed } from "../shared/dom.js";
import { clamp, filled, shortened } from "../shared/numbers.js";
import { onKey, Panel, show } from "../shared/panel.js";

export default (component) => show(FunnelPanel, component);

class FunnelPanel extends Panel {
  constructor(parent) {
    super(parent, "funnel");
    this.bars = this.find(".bars");
    onKey(this.bars, () => this.first && this.actions());
    this.bars.addEventListener("click", (event) => this.pickBar(event));
    this.find(".template").addEventListener("click", (event) => this.pickPixel(event));
  }

  begin(data) {
    const { words } = data;
    this.colour({ frame: data.frame });
    for (const [name, said] of Object.entries(words.texts)) this.find(name).textContent = said;
    for (const name of ["picture", "template"]) this.find(`.${name} img`).src = data[name];
    this.find(".picture").setAttribute("aria-label", words.picture);
    this.find(".picture svg").setAttribute("viewBox", `0 0 ${data.cols} ${data.rows}`);
    this.find(".template svg").setAttribute("viewBox", `0 0 ${data.width} ${data.height}`);
    this.find(".steps").setAttribute("aria-label", words.steps_label);
    this.bars.setAttribute("aria-label", words.colours);
    this.first = data.anchors[0]; // the one used by the search
    this.sorted = [...data.anchors].sort((one, other) => one.counts[1] - other.counts[1]);
    this.find(".hint").textContent = this.first ? words.hint : words.nothing;
    this.find(".desk").hidden = this.find(".colours").hidden = !this.first;
    if (!this.first) return;
    described(this.bars, { "aria-valuemin": 1, "aria-valuemax": this.sorted.length });
    const most = this.sorted.at(-1).counts[1];
    this.bars.replaceChildren(...this.sorted.map((anchor) => bar(anchor, most)));
    this.find(".steps").replaceChildren(...words.steps.map((name, at) => this.step(name, at)));
    this.reached = 0;
    this.pick(this.first);
  }

  step(name, at) {
    return button([element("span", "what", name), element("span", "count"), element("span", "share")], () => {
      this.reached = at;
      this.draw();
    });
  }

  pick(anchor) {
    this.anchor = anchor;
    this.draw();
  }

  pickAt(place) {
    this.pick(this.sorted[clamp(place, 0, this.sorted.length - 1)]);
  }

  pickBar(event) {
    this.pickAt(Math.floor(shareOf(event, this.bars)[0] * this.sorted.length));
  }

  // Picks the nearest of the pixels that can be picked.
  pickPixel(event) {
    const [right, down] = shareOf(event, this.find(".template"));
    const [row, col] = [down * this.data.height, right * this.data.width];
    const far = (anchor) => Math.hypot(anchor.row + 0.5 - row, anchor.col + 0.5 - col);
    this.pick(this.sorted.reduce((best, anchor) => (far(anchor) < far(best) ? anchor : best)));
  }

  actions() {
    const at = this.sorted.indexOf(this.anchor);
    const [before, after] = [() => this.pickAt(at - 1), () => this.pickAt(at + 1)];
    const ends = { Home: () => this.pickAt(0), End: () => this.pickAt(Infinity) };
    return { ArrowLeft: before, ArrowDown: before, ArrowRight: after, ArrowUp: after, ...ends };
  }

  draw() {
    const { anchor, reached } = this;
    const { words } = this.data;
    const steps = this.find(".steps").children;
    showPressed(steps, (one) => one === steps[reached]);
    [...steps].forEach(({ children: [, count, share] }, at) => {
      count.textContent = shortened(anchor.counts[at]);
      share.style.width = logarithmic(anchor.counts[at], anchor.counts[0]);
    });
    this.drawDots();
    this.drawAnchor();
    const at = this.sorted.indexOf(anchor);
    [...this.bars.children].forEach((one, index) => one.classList.toggle("picked", index === at));
    const named = filled(words.colour, { row: anchor.row, col: anchor.col, count: shortened(anchor.counts[1]) });
    this.find(".colour").textContent = named;
    described(this.bars, { "aria-valuenow": at + 1, "aria-valuetext": named });
    this.find(".said").textContent = filled(words.said[reached], { scored: shortened(anchor.scored) }) + this.outcome();
  }

  outcome() {
    const { anchor, reached, data: { words } } = this;
    if (!reached) return "";
    if (!anchor.counts[reached]) return words.none;
    const shown = anchor.dots[reached - 1].length;
    if (reached < 3) return shown < anchor.counts[reached] ? filled(words.some, { shown: shortened(shown) }) : "";
    if (!anchor.best) return words.many;
    const [row, col, score] = anchor.best;
    return filled(words.best, { row, col, score: shortened(score, 3) });
  }

  drawDots() {
    const { anchor, reached, data } = this;
    this.find(".picture").classList.toggle("thinned", reached > 0);
    const parts = [];
    if (reached) {
      const d = anchor.dots[reached - 1].map(([row, col]) => `M${col + 0.5} ${row + 0.5}h0`).join("");
      parts.push(...haloed("path", ["halo", "dots"], { d }));
    }
    if (reached === 3 && anchor.best) {
      const [row, col] = anchor.best;
      parts.push(...haloed("rect", ["around", "place"], { x: col, y: row, width: data.width, height: data.height }));
    }
    this.find(".picture svg").replaceChildren(...parts);
  }

  drawAnchor() {
    const { row, col, run } = this.anchor;
    const [y, first, last] = [row + 0.5, run[0] + 0.5, run[1] + 0.5];
    this.find(".template svg").replaceChildren(
      ...haloed("path", ["around", "place"], { d: `M${first} ${y}H${last}` }),
      ...haloed("path", ["halo", "dots"], { d: `M${first} ${y}h0M${last} ${y}h0` }),
      ...haloed("circle", ["around", "place"], { cx: col + 0.5, cy: y, r: this.data.width / 22 }),
    );
  }
}

const logarithmic = (count, most) => `${(100 * Math.log(1 + count)) / Math.log(1 + most)}%`;

function bar(anchor, most) {
  const inner = element("span");
  inner.style.height = logarithmic(anchor.counts[1], most);
  inner.style.background = `rgb(${anchor.colour})`;
  return element("div", "bar", inner);
}

// A shape twice, of two classes: first its halo.
function haloed(tag, classes, shape) {
  return classes.map((name) => node(tag, { class: name, ...shape }));
}
