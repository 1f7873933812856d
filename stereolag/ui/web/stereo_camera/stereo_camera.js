// Sends the views of a stereo camera, of two cameras or of one moved by hand, and shows the maps that come back in place
// of those on the page.

import { tell } from "../shared/exchange.js";
import { camera, devices, jpeg, LivePanel } from "../shared/live.js";
import { unpacked } from "../shared/packing.js";
import { show } from "../shared/panel.js";

const TWO = "two";
const MOVED = "moved";
const FROZEN_QUALITY = 0.97;

export default (component) => show(StereoCamera, component);

class StereoCamera extends LivePanel {
  constructor(parent) {
    super(parent, "stereo-camera");
    this.canvas = this.find("canvas");
    this.chosen = [this.find(".one"), this.find(".two")];
    this.names = ["", ""]; // of the chosen devices
    this.chosen.forEach((one, at) => one.addEventListener("change", () => this.choose(at, one.value)));
    this.find(".swap").addEventListener("click", () => this.choose(0, this.names[1]));
    this.find(".first").addEventListener("click", () => (this.first = this.picture(this.videos, 1)));
    this.find(".freeze").addEventListener("click", () => (this.freezing = true));
    this.find(".record").addEventListener("click", () => (this.recording ? this.finish() : this.record()));
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
    const on = Boolean(this.media);
    this.find(".two").hidden = this.find(".swap").hidden = this.find(".skew").hidden = this.arrangement !== TWO;
    this.find(".first").hidden = !on || this.arrangement !== MOVED;
    this.find(".freeze").hidden = !on || this.data.record || (this.arrangement === MOVED && !this.first);
    this.find(".record").hidden = !on || !this.data.record;
    this.find(".record").textContent = this.data.words[this.recording ? "finish" : "record"];
    this.find(".first").textContent = this.data.words[this.first ? "again" : "first"];
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
    this.first = null;
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
    if (!freezing && !videos.every((one) => one.fresh)) return null;
    const at = performance.now();
    for (const one of videos) one.fresh = false;
    if (this.arrangement === TWO) {
      const apart = Math.abs(videos[0].seen - videos[1].seen);
      this.find(".skew").textContent = `${this.data.words.skew} ${apart.toFixed(0)}\u00a0ms`;
    }
    const scale = freezing ? 1 : Math.min(1, this.data.width / this.widthOfView());
    const picture = this.picture(this.first ? [this.first, ...videos] : videos, scale);
    this.draw(picture);
    this.offer();
    if (this.arrangement === MOVED && !this.first) return null;
    if (this.data.record) return this.recording ? { at, header: { at }, parts: await this.viewsOf(picture) } : null;
    this.freezing = false;
    return { at, header: { freeze: Boolean(freezing) }, parts: [await jpeg(picture, freezing ? FROZEN_QUALITY : undefined)] };
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

  // The JPEGs of both views, the left one first; squeezed ones at the shape they were taken in.
  async viewsOf(picture) {
    const [across, squeezed] = [!this.arrangement.endsWith("over-under"), this.arrangement.startsWith("half-")];
    const wide = Math.floor(picture.width / (across ? 2 : 1));
    const high = Math.floor(picture.height / (across ? 1 : 2));
    const both = [];
    for (const at of [0, 1]) {
      const view = new OffscreenCanvas(wide * (squeezed && across ? 2 : 1), high * (squeezed && !across ? 2 : 1));
      const [x, y] = across ? [at * wide, 0] : [0, at * high];
      view.getContext("2d").drawImage(picture, x, y, wide, high, 0, 0, view.width, view.height);
      both.push(await jpeg(view, FROZEN_QUALITY));
    }
    return this.data.crossed ? both.reverse() : both;
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
