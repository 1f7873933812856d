// Asks Python for the map where the handle of a slider is while it is dragged, and shows it: Streamlit's slider tells Python
// where it was released, and nothing before.

import { tell } from "../shared/exchange.js";
import { unpacked } from "../shared/packing.js";
import { Panel, show } from "../shared/panel.js";

const EVERY_MS = 80;
const NAMED = "st-key-depth-"; // begins the class of a slider's box, from the key of its control

export default (component) => show(DraggingPanel, component);

class DraggingPanel extends Panel {
  constructor(parent) {
    super(parent, "dragging");
    this.listen("pointerdown", ({ target }) => this.take(target.closest(`[class*=${NAMED}]`)));
    for (const type of ["pointerup", "pointercancel"]) this.listen(type, () => this.release());
    this.gone.signal.addEventListener("abort", () => clearInterval(this.looking));
  }

  take(box) {
    this.handle = box?.querySelector("input[type=range]");
    if (!this.handle) return;
    this.slider = [...box.classList].find((name) => name.startsWith(NAMED));
    this.start = this.asked = this.handle.value;
    this.waits = false;
    this.looking = setInterval(() => this.look(), EVERY_MS);
  }

  // Asks for the latest place once the place before is answered.
  look() {
    if (this.waits || this.handle.value === this.asked) return;
    this.asked = this.handle.value;
    this.waits = true;
    this.trigger("at", { slider: this.slider, value: Number(this.asked) });
  }

  load(data) {
    this.waits = false;
    if (data && this.handle) tell("preview", (this.item = unpacked(data)));
  }

  // The map of the new place is on its way, unless the handle is back where it was.
  release() {
    clearInterval(this.looking);
    if (this.item && this.handle.value === this.start) tell("preview", { ...this.item, parts: [] });
    this.handle = this.item = null;
  }
}
