// A box cut from a live camera picture, followed by the server; every frame is shown with its own answer.

import { cut, gapped, placeIn } from "../shared/dom.js";
import { jpeg, LivePanel } from "../shared/live.js";
import { clamp } from "../shared/numbers.js";
import { arrows } from "../shared/panel.js";

const LARGEST = 1280; // longer side of a frame, px
const PATH = 150; // number of last places drawn

export default class FollowingPanel extends LivePanel {
  box = null; // the box being drawn, px of the frame; null while one is followed
  held = false; // whether the picture is frozen while a box is drawn on it
  wanted = null; // the box to be cut, with the frame on which it was drawn
  cutting = false; // whether that has been sent
  still = null; // the frame shown
  item = null; // its answer
  path = [];

  async open(run) {
    Object.assign(this, { box: null, held: false, wanted: null, cutting: false, still: null, item: null, path: [] });
    const video = await run.camera(this.chosen[0]);
    await this.listDevices();
    return video;
  }

  stopped() {
    this.box = null;
  }

  // Forgets what was followed, so that another box can be drawn.
  anew() {
    if (!this.still) return;
    const { width, height } = this.still;
    Object.assign(this, { item: null, path: [], cutting: false });
    this.fit({ width: Math.round(width / 6), height: Math.round(height / 5) }, [height / 2, width / 2]);
  }

  cut() {
    if (!this.box) return;
    this.wanted = { box: this.box, still: this.still };
    this.box = null;
    this.held = false;
    this.fault = "";
    this.draw();
  }

  frozen() {
    this.stop();
    this.trigger("frozen", Date.now());
  }

  async grab() {
    const video = this.media;
    if (this.cutting && this.fault) this.anew(); // it cannot be followed: the bar says why
    if (this.wanted) {
      const { box, still } = this.wanted;
      Object.assign(this, { wanted: null, cutting: true });
      return { header: { box }, parts: [await jpeg(still)], still };
    }
    if (this.cutting || this.held || video.currentTime === this.time) return null;
    this.time = video.currentTime;
    const scale = Math.min(1, LARGEST / Math.max(video.videoWidth, video.videoHeight));
    const still = this.picture([video], scale);
    if (this.still && !this.box) return { parts: [await jpeg(still)], still };
    const first = !this.still;
    this.still = still;
    if (first) this.anew();
    this.schedule();
    return null;
  }

  answered(item, { still }) {
    this.cutting = false;
    if (this.box || this.wanted) return;
    Object.assign(this, { still, item });
    this.path = [...this.path, item.place && `${item.place.col} ${item.place.row}`].slice(-PATH);
    this.trail = gapped(this.path);
    this.schedule();
  }

  // A box by the pointer is followed as soon as it is released.
  grabbed(event) {
    if (!this.running || !this.still) return null;
    this.held = true;
    const [fromRow, fromCol] = this.placeOf(event);
    let moved = false;
    return {
      move: (event) => {
        const [row, col] = this.placeOf(event);
        if (!moved) [this.item, this.path] = [null, []];
        moved = true;
        const size = { height: Math.abs(row - fromRow), width: Math.abs(col - fromCol) };
        this.fit(size, [(row + fromRow) / 2, (col + fromCol) / 2]);
      },
      end: (released) => {
        this.held = false;
        if (moved && released) this.cut();
      },
    };
  }

  actions(event) {
    if (!this.running || !this.still) return null;
    if (!this.box) return { Escape: () => this.anew() };
    const { row, col, height, width } = this.box;
    const sized = (by) => this.fit({ height: height + by, width: width + by }, [row + height / 2, col + width / 2]);
    return {
      ...arrows(event, (down, right) => this.fit({ height, width }, [row + down + height / 2, col + right + width / 2])),
      "+": () => sized(4),
      "-": () => sized(-4),
      Enter: () => this.cut(),
    };
  }

  // Shows a box of this size around a centre, as far as the picture and the smallest side allow.
  fit(size, [row, col]) {
    const { width: cols, height: rows } = this.still;
    const [height, width] = [[size.height, rows], [size.width, cols]].map(([side, end]) => clamp(Math.round(side), this.data.least, end));
    const [top, left] = [[row - height / 2, rows - height], [col - width / 2, cols - width]].map(([at, end]) => clamp(Math.round(at), 0, end));
    this.box = { row: top, col: left, height, width };
    this.schedule();
  }

  placeOf(event) {
    const { height: rows, width: cols } = this.still;
    return placeIn(event, this.find("canvas"), { rows, cols });
  }

  draw() {
    this.render();
    if (this.still) cut(this.find("canvas"), this.still);
  }
}
