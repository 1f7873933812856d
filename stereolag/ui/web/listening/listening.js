// Two microphones heard live: how loud they are, their waveforms, the lag that the server finds, and where it points.

import { branch, SENSORS } from "../shared/hyperbola.js";
import { LivePanel } from "../shared/live.js";
import { clamp, total } from "../shared/numbers.js";
import { joined, listening } from "./pieces.js";

const PIECE_S = 0.18; // least duration of a message: rounded up to whole blocks, that is five messages a second
const KEPT_S = 2; // duration of the sound that is drawn, and that the server keeps
const COLUMN = 256; // samples drawn as one line
const LOWEST_DB = -60;
const QUIETEST = 0.02; // of full scale: quieter sound is not magnified further
const THINNEST = 3; // of 200, so that silence is visible
const FLOOR = 126; // y of the sensors in their drawing, px

export default class Listening extends LivePanel {
  kind = "audioinput"; // two are chosen, or the second is "", for the second channel of the first one
  inUse = 1; // number of devices
  levels = [0, 0]; // how loud both are, 0..1
  collected = []; // blocks not sent yet
  columns = []; // the blocks drawn
  most = 1; // number of columns
  lag = "–";
  difference; // of the paths, m
  isOld = true; // whether the lag is out of date
  said = "";
  hasAnswer = false;
  kept = false; // whether the server has been asked to freeze the sound

  setUp() {
    navigator.mediaDevices?.addEventListener?.("devicechange", () => this.running && this.listDevices(), { signal: this.gone.signal });
  }

  begin(data) {
    super.begin(data);
    this.kept = false;
  }

  // Asks the server to freeze the sound heard now; the page then uses it as its recordings.
  keep() {
    this.kept = true;
    this.asked = Date.now();
    this.render();
  }

  async listDevices() {
    await super.listDevices();
    this.chosen[0] ||= this.devices[0]?.deviceId ?? "";
  }

  async open(run) {
    [this.collected, this.columns] = [[], []];
    const [first, second] = this.chosen;
    const chosen = second && second !== first ? [first, second] : [first];
    this.inUse = chosen.length;
    this.begun = Date.now();
    const media = await listening(run, chosen, (block) => this.take(block));
    queueMicrotask(() => this.listDevices());
    return media;
  }

  stopped() {
    Object.assign(this, { hasAnswer: false, levels: [0, 0], isOld: true });
  }

  // Takes a block of both channels, and draws it.
  take(block) {
    if (!this.running) return;
    this.collected.push(block);
    const length = block[0].length;
    const kept = KEPT_S * (this.media?.rate ?? 48_000);
    this.collected.splice(0, this.collected.length - Math.ceil(kept / length));
    for (let at = 0; at < length; at += COLUMN) {
      this.columns.push(block.map((samples) => {
        const part = samples.subarray(at, at + COLUMN);
        return [Math.min(...part), Math.max(...part)];
      }));
    }
    this.most = Math.ceil(kept / COLUMN);
    this.columns.splice(0, this.columns.length - this.most);
    this.levels = block.map((samples) => {
      const decibels = 10 * Math.log10(total(samples.map((one) => one ** 2)) / length + 1e-12);
      return clamp(1 - decibels / LOWEST_DB, 0, 1);
    });
    this.schedule();
  }

  async grab() {
    const count = this.collected.length * (this.collected[0]?.[0].length ?? 0);
    const { rate } = this.media;
    if (count < PIECE_S * rate) return null;
    const parts = joined(this.collected, Math.round(KEPT_S * rate));
    this.collected = [];
    const header = { rate, devices: this.inUse, begun: this.begun, freeze: this.asked };
    this.asked = undefined;
    return { header, parts };
  }

  // Shows a lag and where it points; an outdated one stays, faint.
  answered({ sure, lag, difference, said, frozen }) {
    this.hasAnswer = true;
    if (frozen) this.trigger("freeze", frozen);
    this.said = said;
    this.isOld = !sure;
    if (sure) Object.assign(this, { lag, difference });
    this.schedule();
  }

  // The path of a channel's waveform, 200 high and one unit wide per column, the newest at the right.
  wave(channel) {
    const columns = this.columns.map((both) => both[channel]);
    const highest = columns.reduce((most, [low, high]) => Math.max(most, high, -low), QUIETEST);
    return columns.map(([low, high], at) => {
      const [top, height] = [100 - (100 * high) / highest, Math.max((100 * (high - low)) / highest, THINNEST)];
      return `M${this.most - columns.length + at} ${top.toFixed(1)}h1v${height.toFixed(1)}h-1z`;
    }).join("");
  }

  // Both sensors, every place with the path difference, and a needle along them.
  layOut(width) {
    const { difference = 0 } = this;
    const apart = Math.max(Number(this.find(".place input").value) || 0.01, Math.abs(difference));
    /** @type {(place: number[]) => number[]} */
    const at = ([x, y]) => [(width * (2 + x)) / 4, FLOOR - (width * y) / 4];
    return {
      same: `M${branch(difference / apart).filter(([, y]) => y >= 0).map(at).join("L")}`,
      turn: (-180 * Math.asin(difference / apart)) / Math.PI,
      sensors: SENSORS.map(at),
    };
  }
}
