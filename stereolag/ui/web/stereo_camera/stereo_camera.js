// Sends the views of a stereo camera, of two cameras or of one moved by hand, and shows the maps that come back instead
// of those on the page.

import { cut } from "../shared/dom.js";
import { tell } from "../shared/exchange.js";
import { jpeg } from "../shared/live.js";
import { unpacked } from "../shared/packing.js";
import { jpegs, KEPT_QUALITY, StereoPanel } from "../shared/stereo_panel.js";

export default class StereoCamera extends StereoPanel {
  first = null; // the left picture from a camera moved by hand
  recording = false;
  freezing = false;
  count = 0; // number of frames recorded

  get isMoved() {
    return this.arrangement === "moved";
  }

  // Starts a recording, or ends it; Python then makes a drive of it.
  record() {
    if (this.recording) this.stop();
    this.recording = Boolean(this.media);
    this.count = 0;
    this.render();
  }

  stopped() {
    if (this.recording) this.trigger("recorded", performance.now());
    Object.assign(this, { recording: false, first: null, shape: null });
  }

  async grab() {
    const { media: videos, freezing } = this;
    if (!this.isFresh() && !freezing) return null;
    const at = performance.now();
    const width = videos[0].videoWidth / (this.arrangement === "beside" ? 2 : 1); // width of a view
    const scale = freezing ? 1 : Math.min(1, this.data.width / width);
    const picture = this.picture(this.first ? [this.first, ...videos] : videos, scale);
    this.drawPicture(picture);
    this.render();
    if (this.isMoved && !this.first) return null;
    if (this.data.record) return this.recording ? { at, header: { at }, parts: await jpegs(this.views(picture)) } : null;
    this.freezing = false;
    return { at, header: { freeze: Boolean(freezing) }, parts: [await jpeg(picture, freezing ? KEPT_QUALITY : undefined)] };
  }

  // Shows the picture as it is sent; for a camera moved by hand, the first one half transparent over the second.
  drawPicture(picture) {
    const { first } = this;
    const wide = first ? picture.width / 2 : picture.width;
    const [shown, over] = this.findAll("canvas");
    cut(shown, picture, first ? wide : 0, 0, wide, picture.height);
    if (first) cut(over, picture, 0, 0, wide, picture.height);
  }

  answered({ shape, frozen, count, parts }) {
    if (count) this.count = count;
    if (this.data.record) return undefined;
    if (frozen) return this.trigger("frozen", frozen);
    for (const part of parts) tell("preview", unpacked(part));
    if (String(shape) === this.shape) return;
    this.shape = String(shape);
    this.trigger("shape", shape);
  }
}
