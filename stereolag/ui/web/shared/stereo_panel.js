// Both views of a stereo camera: from one camera whose pictures hold both, or from two.

import { html } from "./lit_html.js";
import { jpeg, LivePanel } from "./live.js";

export const KEPT_QUALITY = 0.97;

export class StereoPanel extends LivePanel {
  arrangement = ""; // arrangement of the views
  skew = ""; // the time between both views, in words

  begin(data) {
    const before = this.arrangement;
    this.arrangement = data.arrangement;
    super.begin(data);
    if (before && before !== data.arrangement) this.stop();
    this.listDevices();
  }

  get isTwo() {
    return this.arrangement === "two";
  }

  // Uses a device for one of the views; if the other view had it, they swap devices.
  choose(at, name) {
    if (this.chosen[1 - at] === name) this.chosen[1 - at] = this.chosen[at];
    if (this.running) super.choose(at, name);
    else this.set({ chosen: this.chosen.with(at, name) });
  }

  // The markup of the cameras in use.
  cameras() {
    return html`
      ${this.chooser(0, "Camera", this.devices.length < 2)}${this.chooser(1, "Right camera", !this.isTwo)}
      <button type="button" class="swap" ?hidden=${!this.isTwo} @click=${() => this.choose(0, this.chosen[1])}>Swap left and right</button>`;
  }

  async listDevices() {
    await super.listDevices();
    this.chosen = this.chosen.map((name, at) => name || (this.devices[at]?.deviceId ?? ""));
  }

  async open(run) {
    const videos = [];
    for (const name of this.chosen.slice(0, this.isTwo ? 2 : 1)) videos.push(await run.camera(name));
    await this.listDevices(); // they have names only now
    const used = run.tracks.map((track) => track.getSettings().deviceId);
    if (new Set(used).size < videos.length) throw Object.assign(new Error(), { name: "oneCamera" });
    used.forEach((device, at) => (this.chosen[at] = device));
    videos.forEach((one) => watch(one, () => this.wake()));
    return videos;
  }

  // Whether all cameras have a new picture, which then counts as seen.
  isFresh() {
    const videos = this.media;
    if (!videos.every((one) => one.fresh)) return false;
    for (const one of videos) one.fresh = false;
    if (this.isTwo) this.skew = `${this.data.words.skew} ${Math.abs(videos[0].seen - videos[1].seen).toFixed(0)}\u00a0ms`;
    return true;
  }

  // Both views in one picture, the left one first; squeezed ones at their original shape.
  views(picture) {
    const [across, squeezed] = [!this.arrangement.endsWith("over-under"), this.arrangement.startsWith("half-")];
    const wide = Math.floor(picture.width / (across ? 2 : 1));
    const high = Math.floor(picture.height / (across ? 1 : 2));
    const both = [0, 1].map((at) => {
      const view = new OffscreenCanvas(wide * (squeezed && across ? 2 : 1), high * (squeezed && !across ? 2 : 1));
      const [x, y] = across ? [at * wide, 0] : [0, at * high];
      view.getContext("2d").drawImage(picture, x, y, wide, high, 0, 0, view.width, view.height);
      return view;
    });
    return this.data.crossed ? both.reverse() : both;
  }
}

// Pictures as JPEGs, to be kept as files.
export const jpegs = (pictures) => Promise.all(pictures.map((one) => jpeg(one, KEPT_QUALITY)));

// Records the capture time of every new frame of a video.
function watch(video, told) {
  const note = (_, { captureTime, expectedDisplayTime }) => {
    Object.assign(video, { fresh: true, seen: captureTime ?? expectedDisplayTime });
    told();
    video.requestVideoFrameCallback(note);
  };
  video.requestVideoFrameCallback(note);
}
