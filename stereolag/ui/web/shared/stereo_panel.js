// Both views of a stereo camera: from one camera whose pictures hold both, or from two. A panel of such has two selections
// of a device, `.one` and `.two`, a button `.swap`, and `.skew` for the time between both views.

import { camera, devices, jpeg, LivePanel } from "./live.js";

const TWO = "two";
export const KEPT_QUALITY = 0.97;

export class StereoPanel extends LivePanel {
  constructor(parent, name) {
    super(parent, name);
    this.chosen = [this.find(".one"), this.find(".two")];
    this.names = ["", ""]; // of the chosen devices
    this.chosen.forEach((one, at) => one.addEventListener("change", () => this.choose(at, one.value)));
    this.find(".swap").addEventListener("click", () => this.choose(0, this.names[1]));
  }

  begin(data) {
    const before = this.arrangement;
    this.arrangement = data.arrangement;
    super.begin(data);
    if (before !== undefined && before !== data.arrangement) this.stop();
    this.offer();
    this.listDevices();
  }

  // Takes a device for one of the views; if the other view had it, that gets the one given up.
  choose(at, name) {
    const before = this.names[at];
    this.names[at] = name;
    if (this.names[1 - at] === name) this.names[1 - at] = before;
    this.chosen.forEach((one, which) => (one.value = this.names[which]));
    if (this.running) {
      this.stop();
      this.start();
    }
  }

  // Shows the controls that mean something now.
  offer() {
    for (const name of [".two", ".swap", ".skew"]) this.find(name).hidden = this.arrangement !== TWO;
  }

  async listDevices() {
    const all = await devices("videoinput");
    this.chosen.forEach((one, at) => {
      one.replaceChildren(...all.map(({ deviceId, label }) => new Option(label, deviceId)));
      one.value = this.names[at] ||= all[at]?.deviceId ?? "";
    });
    this.find(".one").hidden = all.length < 2;
  }

  async open() {
    const cameras = [];
    try {
      for (const name of this.names.slice(0, this.arrangement === TWO ? 2 : 1)) cameras.push(await camera(name));
      await this.listDevices(); // they have names only now
      if (this.arrangement === TWO && new Set(cameras.map(deviceOf)).size < 2) {
        throw Object.assign(new Error(), { name: "oneCamera" });
      }
    } catch (error) {
      cameras.forEach((one) => one.close());
      throw error;
    }
    cameras.forEach((one, at) => (this.chosen[at].value = this.names[at] = deviceOf(one)));
    this.videos = cameras.map(({ video }) => video);
    this.videos.forEach((one) => watch(one, () => this.wake()));
    return {
      get ended() {
        return cameras.some(({ ended }) => ended);
      },
      close: () => cameras.forEach((one) => one.close()),
    };
  }

  // Whether all cameras have a new picture, which is then taken for seen.
  isFresh() {
    const { videos } = this;
    if (!videos.every((one) => one.fresh)) return false;
    for (const one of videos) one.fresh = false;
    if (this.arrangement === TWO) {
      const apart = Math.abs(videos[0].seen - videos[1].seen);
      this.find(".skew").textContent = `${this.data.words.skew} ${apart.toFixed(0)}\u00a0ms`;
    }
    return true;
  }

  widthOfView() {
    const [{ videoWidth }] = this.videos;
    return this.arrangement === "beside" ? videoWidth / 2 : videoWidth;
  }

  // Pictures beside each other, at a scale; those of other sizes are fitted to the first.
  picture(sources, scale) {
    const wide = Math.round(scale * (sources[0].videoWidth ?? sources[0].width));
    const high = Math.round(scale * (sources[0].videoHeight ?? sources[0].height));
    const canvas = new OffscreenCanvas(wide * sources.length, high);
    sources.forEach((one, at) => canvas.getContext("2d").drawImage(one, at * wide, 0, wide, high));
    return canvas;
  }

  // Both views in a picture, the left one first; squeezed ones at the shape they were taken in.
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

// The JPEGs of some pictures that are kept as files.
export const jpegs = (pictures) => Promise.all(pictures.map((one) => jpeg(one, KEPT_QUALITY)));

const deviceOf = ({ media }) => media.getVideoTracks()[0].getSettings().deviceId;

// Notes of every new frame of a video when it was captured.
function watch(video, told) {
  const note = (_, { captureTime, expectedDisplayTime }) => {
    Object.assign(video, { fresh: true, seen: captureTime ?? expectedDisplayTime });
    told();
    video.requestVideoFrameCallback(note);
  };
  video.requestVideoFrameCallback(note);
}
