// Asks Python for the map of a moved slider: from smaller images while its handle is dragged, and the map itself as soon
// as it is released or moved by a key. Over its own socket that is faster than the run of the page, which brings the same
// map and everything else; without a socket, only that run comes.

import { tell } from "../shared/exchange.js";
import { unpacked, packed } from "../shared/packing.js";
import { Panel } from "../shared/panel.js";
import { socketTo } from "../shared/socket.js";

const EVERY_MS = 80;
const STEPS = { ArrowRight: "stepUp", ArrowUp: "stepUp", ArrowLeft: "stepDown", ArrowDown: "stepDown" };
const NAMED = "st-key-depth-"; // prefix of the class of a slider's box, from the key of its control

export default (component) => SlidersPanel.show(component);

class SlidersPanel extends Panel {
  constructor(parent) {
    super(parent);
    this.listen("pointerdown", ({ target }) => this.take(target));
    for (const type of ["pointerup", "pointercancel"]) this.listen(type, () => this.release());
    this.listen("focusin", ({ target }) => this.sliderOf(target) && this.connect());
    this.listen("keydown", (event) => this.press(event));
    this.atEnd(() => {
      clearInterval(this.looking);
      this.socket?.close();
    });
  }

  // The handle of the slider that an element belongs to, and the class of its box.
  sliderOf(target) {
    const box = target.closest?.(`[class*=${NAMED}]`);
    const handle = box?.querySelector("input[type=range]");
    return handle && { handle, name: [...box.classList].find((name) => name.startsWith(NAMED)) };
  }

  take(target) {
    clearInterval(this.looking); // a second finger comes down before the first is lifted
    this.dragged = this.sliderOf(target);
    if (!this.dragged) return;
    this.start = this.seen = this.dragged.handle.value;
    this.connect();
    this.looking = setInterval(() => this.look(), EVERY_MS);
  }

  look() {
    const { handle, name } = this.dragged;
    if (handle.value !== this.seen) this.ask(name, (this.seen = handle.value), false);
  }

  // The map of the new place, unless the handle is back where it was.
  release() {
    if (!this.dragged) return;
    const { handle, name } = this.dragged;
    clearInterval(this.looking);
    this.dragged = this.next = null;
    if (handle.value !== this.start) this.ask(name, handle.value, true);
    else if (this.item) tell("preview", { ...this.item, parts: [], figures: undefined });
    this.item = null;
  }

  // The slider has its new value only once the whole page has reacted to the key: an arrow key implies it at once.
  press({ target, key }) {
    const { handle, name } = this.sliderOf(target) ?? {};
    if (!handle || handle.disabled) return;
    const expected = handle.cloneNode();
    if (STEPS[key]) expected[STEPS[key]]();
    const ask = (before, value) => value !== before && this.ask(name, value, true);
    ask(handle.value, expected.value);
    setTimeout(() => ask(expected.value, handle.value));
  }

  connect() {
    if (this.socket || !this.data.address) return;
    this.socket = socketTo(this.data, () => this.send(), (data) => this.answered(unpacked(new Uint8Array(data))));
    this.socket.onclose = () => (this.socket = this.asked = null);
  }

  // Asks for the latest place once the previous one is answered.
  ask(slider, value, whole) {
    this.next = { slider, value: Number(value), whole };
    this.connect();
    this.send();
  }

  send() {
    if (!this.next || this.asked || this.socket?.readyState !== WebSocket.OPEN) return;
    this.socket.send(packed(this.next));
    [this.asked, this.next] = [this.next, null];
  }

  answered({ parts: [picture], ...item }) {
    const { whole } = this.asked;
    this.asked = null;
    if (picture && (whole || this.dragged)) {
      const shown = { ...unpacked(picture), ...item };
      if (!whole) this.item = shown;
      tell("preview", shown);
    }
    this.send();
  }
}
