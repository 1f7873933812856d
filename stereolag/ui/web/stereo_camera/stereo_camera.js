// Sends the views of a stereo camera, of two cameras or of one moved by hand, and shows the maps that come back in place
// of those on the page.

import { tell } from "../shared/exchange.js";
import { jpeg } from "../shared/live.js";
import { unpacked } from "../shared/packing.js";
import { show } from "../shared/panel.js";
import { jpegs, KEPT_QUALITY, StereoPanel } from "../shared/stereo_panel.js";

const MOVED = "moved";

export default (component) => show(StereoCamera, component);

class StereoCamera extends StereoPanel {
  constructor(parent) {
    super(parent, "stereo-camera");
    this.canvas = this.find("canvas");
    this.find(".first").addEventListener("click", () => (this.first = this.picture(this.videos, 1)));
    this.find(".freeze").addEventListener("click", () => (this.freezing = true));
    this.find(".record").addEventListener("click", () => (this.recording ? this.finish() : this.record()));
  }

  // Shows the controls that mean something now.
  offer() {
    const on = Boolean(this.media);
    super.offer();
    this.find(".first").hidden = !on || this.arrangement !== MOVED;
    this.find(".freeze").hidden = !on || this.data.record || (this.arrangement === MOVED && !this.first);
    this.find(".record").hidden = !on || !this.data.record;
    this.find(".record").textContent = this.data.words[this.recording ? "finish" : "record"];
    this.find(".first").textContent = this.data.words[this.first ? "again" : "first"];
  }

  async open() {
    this.first = null;
    return super.open();
  }

  record() {
    this.recording = true;
    this.offer();
  }

  // Ends the recording; Python then makes a drive of it.
  finish() {
    this.recording = false;
    this.find(".count").textContent = "";
    this.trigger("recorded", performance.now());
    this.stop();
  }

  stopped() {
    if (this.recording) this.finish();
    this.first = null;
    this.shape = null;
    if (this.data) this.offer();
  }

  async grab() {
    const { videos, freezing } = this;
    if (!this.isFresh() && !freezing) return null;
    const at = performance.now();
    const scale = freezing ? 1 : Math.min(1, this.data.width / this.widthOfView());
    const picture = this.picture(this.first ? [this.first, ...videos] : videos, scale);
    this.draw(picture);
    this.offer();
    if (this.arrangement === MOVED && !this.first) return null;
    if (this.data.record) return this.recording ? { at, header: { at }, parts: await jpegs(this.views(picture)) } : null;
    this.freezing = false;
    return { at, header: { freeze: Boolean(freezing) }, parts: [await jpeg(picture, freezing ? KEPT_QUALITY : undefined)] };
  }

  // The picture as it is sent; of a camera moved by hand the first one, half transparent over the second.
  draw(picture) {
    const { canvas, first } = this;
    const wide = first ? picture.width / 2 : picture.width;
    Object.assign(canvas, { width: wide, height: picture.height });
    const context = canvas.getContext("2d");
    context.drawImage(picture, first ? -wide : 0, 0);
    if (!first) return;
    context.globalAlpha = 0.5;
    context.drawImage(picture, 0, 0);
  }

  answered({ shape, frozen, count, parts }) {
    if (count) this.find(".count").textContent = `${this.data.words.recorded} ${count}`;
    if (this.data.record) return undefined;
    if (frozen) return this.trigger("frozen", frozen);
    for (const part of parts) tell("preview", unpacked(part));
    if (String(shape) === this.shape) return;
    this.shape = String(shape);
    this.trigger("shape", shape);
  }
}
