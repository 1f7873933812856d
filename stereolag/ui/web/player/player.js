// One video contains the left picture and the maps side by side; each is shown on its own canvas, and segments are
// appended as they are computed. Charts below show the figures of every frame and mark the current one.

import { cut, plotted, shareOf } from "../shared/dom.js";
import { eventOf, received } from "../shared/exchange.js";
import { html } from "../shared/lit_html.js";
import { clamp, shortened } from "../shared/numbers.js";
import { arrows, Panel } from "../shared/panel.js";

export default class Player extends Panel {
  frame = 0;
  awaited = null; // the frame sought but not shown yet
  charts = [];
  sample = sample;

  setUp() {
    this.video = this.find("video");
    this.listen(eventOf("video"), () => this.append());
    this.atEnd(() => this.forget());
    const draw = (_, { mediaTime }) => {
      this.showPicture(mediaTime);
      this.video.requestVideoFrameCallback(draw);
    };
    this.video.requestVideoFrameCallback(draw);
  }

  forget() {
    this.video.pause();
    if (this.address) URL.revokeObjectURL(this.address);
    this.video.removeAttribute("src");
    this.address = this.buffer = null;
  }

  load(data) {
    const before = this.data;
    this.data = data;
    this.charts = data.charts.map((chart) => this.chart(chart));
    this.render();
    if (before?.name !== data.name) this.beginVideo();
    this.append();
    this.render();
  }

  // Starts a new video: another sequence, or other settings.
  beginVideo() {
    this.forget();
    this.appended = 0;
    this.frame = 0;
    this.awaited = null;
    this.findAll("canvas").forEach((canvas) => (canvas.width = 0)); // so that pictures of another drive are not mistaken for these
    if (!window.MediaSource) return; // the video is then shown once it is complete
    this.source = new MediaSource();
    this.address = URL.createObjectURL(this.source);
    this.video.src = this.address;
    this.source.addEventListener("sourceopen", () => this.append(), { once: true });
  }

  piece(number) {
    return received("video", `${this.data.name} ${number}`)?.parts[0];
  }

  append() {
    if (!window.MediaSource) return this.appendAll();
    if (this.source?.readyState !== "open" || this.buffer?.updating) return;
    const piece = this.piece(this.appended);
    if (piece) {
      if (!this.buffer) {
        this.buffer = this.source.addSourceBuffer(`video/mp4; codecs="${codec(piece)}"`);
        this.buffer.addEventListener("updateend", () => this.append());
      }
      this.appended += 1;
      this.buffer.appendBuffer(piece);
      if (this.appended === 2) this.go(0);
    } else if (this.data.done && this.appended === this.data.pieces) this.source.endOfStream();
  }

  appendAll() {
    const pieces = Array.from({ length: this.data.pieces }, (_, number) => this.piece(number));
    if (!this.data.done || this.address || !pieces.every(Boolean)) return;
    this.address = URL.createObjectURL(new Blob(pieces, { type: "video/mp4" }));
    this.video.src = this.address;
    this.go(0);
  }

  // Draws the current picture of the video, each part on its own canvas.
  showPicture(time) {
    const { videoWidth, videoHeight } = this.video;
    const width = videoWidth / this.data.titles.length;
    this.findAll("canvas").forEach((canvas, index) => cut(canvas, this.video, index * width, 0, width, videoHeight));
    const frame = clamp(Math.floor(time * this.data.rate + 0.5), 0, this.data.frames - 1);
    if (this.awaited !== null && frame !== this.awaited) return; // an earlier step: the next starts from the latest
    this.awaited = null;
    this.frame = frame;
    this.render();
  }

  toggle() {
    if (!this.video.paused) return this.video.pause();
    if (this.video.ended || this.frame >= this.data.computed - 1) this.go(0);
    this.video.play().catch(() => {}); // interrupted by a pause
  }

  step(by) {
    this.video.pause();
    this.go(this.frame + by);
  }

  go(frame) {
    this.frame = this.awaited = clamp(frame, 0, Math.max(0, this.data.computed - 1));
    this.video.currentTime = (this.frame + 0.5) / this.data.rate;
    this.render();
  }

  actions(event) {
    const { target, key } = event;
    if (target.matches("select, button") || (target.matches("input") && key !== " ")) return {};
    const { ArrowLeft, ArrowRight } = arrows(event, (_, frames) => this.step(frames));
    const ends = { Home: () => this.go(0), End: () => this.go(this.data.computed - 1) };
    return { " ": () => this.toggle(), ArrowLeft, ArrowRight, ...ends };
  }

  get isPaused() {
    return this.video?.paused ?? true;
  }

  seek(event) {
    this.go(Math.round(shareOf(event, event.currentTarget)[0] * (this.data.frames - 1)));
  }

  // The value at this frame as text, if there is one.
  valueOf(values, unit, digits) {
    const value = values?.[this.frame];
    return value == null ? null : shortened(value, digits, unit);
  }

  // The accessible label of a screen: the figures of its method at this frame.
  told(title) {
    const figures = this.data.charts.flatMap(({ name, unit, digits, series }) => {
      const value = this.valueOf(series.find((one) => one.title === title)?.values, unit, digits);
      return value === null ? [] : [`${name.toLowerCase()} ${value}`];
    });
    return `${title}, frame ${this.frame + 1}${figures.length ? `: ${figures.join(", ")}` : ""}`;
  }

  // The line of a method in the charts, if it has one.
  lineOf(title) {
    const line = this.data.charts.flatMap(({ series }) => series).find((one) => one.title === title);
    return line ? sample(line.colour, line.dash) : "";
  }

  chart({ from_zero, ...chart }) {
    const { name, unit, digits, series } = chart;
    const known = (values) => values.filter((value) => value != null);
    const all = series.flatMap(({ values }) => known(values));
    const low = from_zero ? 0 : Math.min(...all);
    const high = Math.max(...all, low + 1e-9);
    const told = series.map(({ title, values }) => {
      const [least, most] = [Math.min(...known(values)), Math.max(...known(values))];
      return `${title} ${shortened(least, digits)} to ${shortened(most, digits, unit)}`;
    });
    const lines = series.map(({ values, colour, dash }) => ({ d: plotted(values), colour, dash }));
    return { ...chart, lines, low, high, label: `${name} over all frames: ${told.join(", ")}` };
  }
}

// A sample of a line of the timeline, shown beside its current value and its title.
const sample = (stroke, dash) =>
  html`<svg class="sample" aria-hidden="true"><path d="M1 6H27" stroke=${stroke} stroke-dasharray=${dash} /></svg>`;

// The codec string of RFC 6381, from the decoder configuration box.
function codec(piece) {
  const text = new TextDecoder("latin1").decode(piece.subarray(0, 4096));
  const at = text.indexOf("avcC") + 5;
  return "avc1." + [...piece.subarray(at, at + 3)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
