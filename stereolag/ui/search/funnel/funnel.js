// The steps of the "sampled" search for any picked pixel of the template, without server requests.

const SVG = "http://www.w3.org/2000/svg";

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const filled = (text, values) => text.replace(/\{(\w+)\}/g, (_, name) => values[name]);

export default function (component) {
  return shown(Panel, component);
}

class Panel {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.bars = this.find(".bars");
    this.bars.addEventListener("keydown", (event) => this.type(event));
    this.bars.addEventListener("click", (event) => this.pickBar(event));
    this.find(".template").addEventListener("click", (event) => this.pickPixel(event));
  }

  load(data) {
    const text = JSON.stringify(data);
    if (text === this.loaded) return; // the page ran again: the picked pixel stays
    this.loaded = text;
    this.data = data;
    const { words } = data;
    for (const [name, said] of Object.entries(words.texts)) this.find(name).textContent = said;
    this.find(".funnel").style.setProperty("--frame", data.frame);
    this.find(".picture img").src = data.picture;
    this.find(".template img").src = data.template;
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
    this.bars.setAttribute("aria-valuemin", 1);
    this.bars.setAttribute("aria-valuemax", this.sorted.length);
    const most = Math.log(1 + this.sorted.at(-1).counts[1]);
    this.bars.replaceChildren(...this.sorted.map((anchor) => bar(anchor, most)));
    this.find(".steps").replaceChildren(...words.steps.map((name, at) => this.step(name, at)));
    this.stage = 0;
    this.pick(this.first);
  }

  step(name, at) {
    const button = Object.assign(document.createElement("button"), { type: "button" });
    button.append(...["what", "count", "share"].map((kind) => Object.assign(document.createElement("span"), { className: kind })));
    button.firstChild.textContent = name;
    button.addEventListener("click", () => {
      this.stage = at;
      this.draw();
    });
    return button;
  }

  pick(anchor) {
    this.anchor = anchor;
    this.draw();
  }

  pickBar(event) {
    const box = this.bars.getBoundingClientRect();
    const share = (event.clientX - box.left) / box.width;
    this.pick(this.sorted[clamp(Math.floor(share * this.sorted.length), 0, this.sorted.length - 1)]);
  }

  // Picks the nearest of the pixels that can be picked.
  pickPixel(event) {
    const box = this.find(".template").getBoundingClientRect();
    const scale = this.data.width / box.width;
    const [row, col] = [(event.clientY - box.top) * scale, (event.clientX - box.left) * scale];
    const far = (anchor) => Math.hypot(anchor.row + 0.5 - row, anchor.col + 0.5 - col);
    this.pick(this.sorted.reduce((best, anchor) => (far(anchor) < far(best) ? anchor : best)));
  }

  type(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.first) return;
    const last = this.sorted.length - 1;
    const at = this.sorted.indexOf(this.anchor);
    const to = { ArrowLeft: at - 1, ArrowDown: at - 1, ArrowRight: at + 1, ArrowUp: at + 1, Home: 0, End: last }[event.key];
    if (to === undefined) return;
    this.pick(this.sorted[clamp(to, 0, last)]);
    event.preventDefault();
  }

  draw() {
    const { anchor, stage } = this;
    const { words } = this.data;
    const most = Math.log(1 + anchor.counts[0]);
    [...this.find(".steps").children].forEach((button, at) => {
      button.setAttribute("aria-pressed", at === stage);
      button.children[1].textContent = shortened(anchor.counts[at]);
      button.children[2].style.width = `${(100 * Math.log(1 + anchor.counts[at])) / most}%`;
    });
    this.drawDots();
    this.drawAnchor();
    const at = this.sorted.indexOf(anchor);
    [...this.bars.children].forEach((one, index) => one.classList.toggle("picked", index === at));
    const named = filled(words.colour, { row: anchor.row, col: anchor.col, count: shortened(anchor.counts[1]) });
    this.find(".colour").textContent = named;
    this.bars.setAttribute("aria-valuenow", at + 1);
    this.bars.setAttribute("aria-valuetext", named);
    this.find(".said").textContent = words.said[stage] + this.outcome();
  }

  outcome() {
    const { anchor, stage, data: { words } } = this;
    if (!stage) return "";
    if (!anchor.counts[stage]) return words.none;
    const shown = anchor.dots[stage - 1].length;
    const some = shown < anchor.counts[stage] ? filled(words.some, { shown: shortened(shown) }) : "";
    if (stage < 3) return some;
    if (!anchor.best) return words.many;
    const [row, col, score] = anchor.best;
    return filled(words.best, { row, col, score: shortened(score, 3) });
  }

  drawDots() {
    const { anchor, stage, data } = this;
    this.find(".picture").classList.toggle("thinned", stage > 0);
    const parts = [];
    if (stage) {
      const d = anchor.dots[stage - 1].map(([row, col]) => `M${col + 0.5} ${row + 0.5}h0`).join("");
      parts.push(drawn("path", { class: "halo", d }), drawn("path", { class: "dots", d }));
    }
    if (stage === 3 && anchor.best) {
      const [row, col] = anchor.best;
      const frame = { x: col, y: row, width: data.width, height: data.height };
      parts.push(drawn("rect", { class: "around", ...frame }), drawn("rect", { class: "place", ...frame }));
    }
    this.find(".picture svg").replaceChildren(...parts);
  }

  drawAnchor() {
    const { row, col, run } = this.anchor;
    const [y, first, last] = [row + 0.5, run[0] + 0.5, run[1] + 0.5];
    const line = { d: `M${first} ${y}H${last}` };
    const ends = { d: `M${first} ${y}h0M${last} ${y}h0` };
    const ring = { cx: col + 0.5, cy: y, r: this.data.width / 22 };
    this.find(".template svg").replaceChildren(
      drawn("path", { class: "around", ...line }), drawn("path", { class: "place", ...line }),
      drawn("path", { class: "halo", ...ends }), drawn("path", { class: "dots", ...ends }),
      drawn("circle", { class: "around", ...ring }), drawn("circle", { class: "place", ...ring }),
    );
  }
}

function bar(anchor, most) {
  const outer = Object.assign(document.createElement("div"), { className: "bar" });
  const inner = document.createElement("span");
  inner.style.height = `${(100 * Math.log(1 + anchor.counts[1])) / most}%`;
  inner.style.background = `rgb(${anchor.colour})`;
  outer.append(inner);
  return outer;
}

function drawn(name, attributes) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  return node;
}
