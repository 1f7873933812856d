// Sliders that disturb two recordings, and the verdict on their lag: all computed here, without server requests.

const WIDE = 0.3; // noise alone never makes the chance band this high

export default function (component) {
  return shown(Panel, component);
}

const filled = (text, values) => text.replace(/\{(\w+)\}/g, (_, name) => values[name]);

class Panel {
  constructor(parent) {
    this.find = (selector) => parent.querySelector(selector);
    this.root = this.find(".disturbances");
    this.svg = this.find("svg");
    this.other = this.find(".other");
    this.other.addEventListener("click", () => this.change({ draw: this.settings.draw + 1 }));
    this.resized = new ResizeObserver(() => this.schedule());
    this.resized.observe(this.find(".drawing"));
  }

  close() {
    this.resized.disconnect();
  }

  load(data) {
    const text = JSON.stringify(data);
    if (text === this.loaded) return; // the page ran again: the sliders stay
    this.loaded = text;
    this.data = data;
    const { fresh, pattern, noises } = data.parts;
    this.parts = { ...data.parts, fresh: bytes(fresh), pattern: bytes(pattern), noises: noises.map(bytes) };
    for (const [name, colour] of Object.entries(data.colours)) this.root.style.setProperty(`--${name}`, colour);
    this.find(".examples").replaceChildren(...data.examples.map((example) => this.button(example)));
    this.find(".sliders").replaceChildren(...data.sliders.map((slider) => this.slider(slider)), this.other);
    this.choose(data.examples[0]);
  }

  button(example) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: example.title });
    button.dataset.name = example.name;
    button.addEventListener("click", () => this.choose(example));
    return button;
  }

  slider({ name, title, low, high, step }) {
    const meaning = this.data.words.sliders[name];
    const label = Object.assign(document.createElement("label"), { title: meaning });
    const input = Object.assign(document.createElement("input"), { type: "range", name, min: low, max: high, step });
    input.addEventListener("input", () => this.change({ [name]: Number(input.value) }));
    input.setAttribute("aria-label", title);
    input.setAttribute("aria-description", meaning);
    label.append(title, document.createElement("output"), input);
    return label;
  }

  choose(example) {
    this.find(".try").textContent = example.try;
    this.change({ ...this.data.start, ...example.settings, draw: 0 });
    for (const button of this.find(".examples").children) {
      button.setAttribute("aria-pressed", button.dataset.name === example.name);
    }
  }

  change(settings) {
    for (const button of this.find(".examples").children) button.setAttribute("aria-pressed", false);
    this.settings = { ...this.settings, ...settings };
    this.judgement = undefined;
    for (const { name, signed, unit } of this.data.sliders) {
      const input = this.find(`input[name=${name}]`);
      const value = this.settings[name];
      const said = `${signed && value > 0 ? "+" : ""}${shortened(value, 0, unit)}`;
      input.value = value;
      input.setAttribute("aria-valuetext", said);
      input.previousElementSibling.textContent = said;
    }
    this.find("input[name=period]").disabled = !this.settings.repetition;
    this.schedule();
  }

  // At most once per frame, however fast a slider moves.
  schedule() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.draw();
    });
  }

  draw() {
    if (!this.settings || !this.svg.clientWidth) return;
    if (!this.judgement) {
      const { repetition, echo } = this.settings;
      this.recordings = mixed(this.parts, { ...this.settings, repetition: repetition / 100, echo: echo / 100 });
      this.judgement = judged(...this.recordings, this.data.reach);
      this.say();
    }
    const { recordings, judgement, data } = this;
    drawDisturbed(this.svg, { recordings, judgement, lag: data.parts.lag, words: data.words });
  }

  say() {
    const { judgement, settings, data } = this;
    const { words } = data;
    const { drift, rivals } = judgement;
    const key = saidOf(judgement, settings, data.parts.lag);
    const numbers = {
      lag: shortened(judgement.lag, 0),
      true: shortened(data.parts.lag, 0),
      delay: shortened(data.parts.echo_delay, 0),
      period: shortened(settings.period, 0),
      spacing: shortened(judgement.spacing ?? 0, 0),
      rivals: rivals.length > 1 ? filled(words.others, { count: rivals.length }) : filled(words.another, { lag: shortened(rivals[0] ?? 0, 0) }),
      from: shortened(drift?.start ?? 0, 1),
      to: shortened(drift ? drift.start + drift.span : 0, 1),
      searched: shortened(judgement.curve.length, 0),
      evidence: shortened(judgement.evidence, 1),
      needed: shortened(judgement.needed, 1),
    };
    const verdict = this.find(".verdict");
    const said = filled(words.verdicts[key], numbers);
    verdict.className = `verdict ${key === "wrong" ? "fooled" : judgement.verdict}`;
    if (verdict.textContent !== said) verdict.textContent = said; // read aloud once
    this.find(".numbers").textContent = filled(words.numbers, numbers);
    const notes = notesOf(judgement, settings, data.parts).map((name) => words.notes[name]);
    this.find(".said").textContent = filled([words.lessons[key], ...notes].join(" "), numbers);
  }
}

// The reason of the verdict, or "wrong" if it is sure of a lag that is not the true one.
function saidOf({ verdict, reason, lag }, { drift }, trueLag) {
  return verdict === "sure" && Math.abs(lag - trueLag) > drift / 2 + 2 ? "wrong" : reason;
}

// The notes to show: a band widened by teeth, or an echo or teeth that rise above chance around a sure peak.
function notesOf({ verdict, curve, ribbon, lag }, { echo, repetition, period }, { lag: trueLag, echo_delay: delay }) {
  const reach = (curve.length - 1) / 2;
  const wide = ribbon[1] > Math.max(WIDE, curve[lag + reach] / 2);
  if (verdict === "ambiguous" && wide) return ["wide"];
  if (verdict !== "sure" || lag !== trueLag) return [];
  const standsOut = (away) => curve[lag + away + reach] > ribbon[1];
  return [...(echo && standsOut(delay) ? ["echo"] : []), ...(repetition && standsOut(-period) && standsOut(period) ? ["teeth"] : [])];
}
