// Asks Python for the map where the handle of a slider is while it is dragged, and shows it: Streamlit's slider tells Python
// where it was released, and nothing before.

import { eventOf, tell } from "../shared/exchange.js";
import { unpacked } from "../shared/packing.js";
import { Panel, show } from "../shared/panel.js";

const EVERY_MS = 80;
const PATIENCE_MS = 3000;
const NAMED = "st-key-depth-"; // begins the class of a slider's box, from the key of its control

export default (component) => show(DraggingPanel, component);

// Of what two parts of a page tell Python in the same moment, Streamlit runs one part alone: a place that was asked for may
// stay without an answer, and a slider that was released without a map.
class DraggingPanel extends Panel {
  constructor(parent) {
    super(parent, "dragging");
    this.listen("pointerdown", ({ target }) => this.take(target.closest(`[class*=${NAMED}]`)));
    for (const type of ["pointerup", "pointercancel"]) this.listen(type, () => this.release());
    this.listen(eventOf("description"), () => clearTimeout(this.unheard));
    this.gone.signal.addEventListener("abort", () => {
      clearInterval(this.looking);
      clearTimeout(this.unheard);
    });
  }

  take(box) {
    this.handle = box?.querySelector("input[type=range]");
    if (!this.handle) return;
    this.slider = [...box.classList].find((name) => name.startsWith(NAMED));
    this.start = this.asked = this.handle.value;
    this.until = 0;
    this.looking = setInterval(() => this.look(), EVERY_MS);
  }

  // Asks for the latest place once the place before is answered.
  look() {
    const { value } = this.handle;
    const waits = Date.now() < this.until;
    if (waits || (value === this.asked && !this.until)) return;
    this.asked = value;
    this.until = Date.now() + PATIENCE_MS;
    this.trigger("at", { slider: this.slider, value: Number(value) });
  }

  load(data) {
    this.until = 0;
    if (data && this.handle) tell("preview", (this.item = unpacked(data)));
  }

  // The map of the new place is on its way, unless the handle is back where it was.
  release() {
    if (!this.handle) return;
    clearInterval(this.looking);
    if (this.handle.value !== this.start) this.unheard = setTimeout(() => this.trigger("unheard", true), PATIENCE_MS);
    else if (this.item) tell("preview", { ...this.item, parts: [], figures: undefined });
    this.handle = this.item = null;
  }
}
