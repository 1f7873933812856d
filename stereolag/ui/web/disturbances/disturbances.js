// Sliders that disturb two recordings, and the verdict on their lag: all computed here, without server requests.

import { element, say } from "../shared/dom.js";
import { filled, shortened } from "../shared/numbers.js";
import { show } from "../shared/panel.js";
import { ExamplesPanel } from "../shared/visiting.js";
import { mixed, withSamples } from "./mixing.js";
import { drawDisturbed } from "./plots.js";
import { judged } from "./verdict.js";

const WIDE = 0.3; // noise alone never makes the chance band this high

export default (component) => show(DisturbancesPanel, component);

class DisturbancesPanel extends ExamplesPanel {
  constructor(parent) {
    super(parent, "disturbances");
    this.svg = this.find("svg");
    this.other = this.find(".other");
    this.other.addEventListener("click", () => this.change({ draw: this.settings.draw + 1 }));
    this.watchSize(this.find(".drawing"));
  }

  begin(data) {
    this.parts = withSamples(data.parts);
    this.find(".sliders").replaceChildren(...data.sliders.map((slider) => this.slider(slider)), this.other);
    super.begin(data);
  }

  slider({ name, title, low, high, step }) {
    const meaning = this.data.words.sliders[name];
    const input = Object.assign(element("input"), { type: "range", name, min: low, max: high, step });
    input.addEventListener("input", () => this.change({ [name]: Number(input.value) }));
    input.setAttribute("aria-label", title);
    input.setAttribute("aria-description", meaning);
    return Object.assign(element("label", "", title, element("output"), input), { title: meaning });
  }

  choose(example) {
    this.change({ ...this.data.start, ...example.settings, draw: 0 });
    super.choose(example);
  }

  change(settings) {
    this.showExample(null);
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

  draw() {
    if (!this.settings || !this.svg.clientWidth) return;
    if (!this.judgement) {
      const { repetition, echo } = this.settings;
      this.recordings = mixed(this.parts, { ...this.settings, repetition: repetition / 100, echo: echo / 100 });
      const [first, second] = this.recordings;
      this.judgement = judged(first, second, this.data.reach);
      this.tell();
    }
    const { recordings, judgement, data } = this;
    drawDisturbed(this.svg, { recordings, judgement, lag: data.parts.lag, words: data.words });
  }

  tell() {
    const { judgement, settings, data } = this;
    const { words } = data;
    const { drift, rivals } = judgement;
    const key = saidOf(judgement, settings, data.parts.lag);
    const numbers = {
      lag: shortened(judgement.lag),
      true: shortened(data.parts.lag),
      delay: shortened(data.parts.echo_delay),
      period: shortened(settings.period),
      spacing: shortened(judgement.spacing ?? 0),
      rivals: rivals.length > 1 ? filled(words.others, { count: rivals.length }) : filled(words.another, { lag: shortened(rivals[0] ?? 0) }),
      from: shortened(drift?.start ?? 0, 1),
      to: shortened(drift ? drift.start + drift.span : 0, 1),
      searched: shortened(judgement.curve.length),
      evidence: shortened(judgement.evidence, 1),
      needed: shortened(judgement.needed, 1),
    };
    const verdict = this.find(".verdict");
    verdict.className = `verdict ${key === "wrong" ? "fooled" : judgement.verdict}`;
    say(verdict, filled(words.verdicts[key], numbers));
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
