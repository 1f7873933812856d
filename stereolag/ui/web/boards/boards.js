// Takes pictures of a board with a stereo camera for a calibration: the server says which of the frames it wants in full
// size, and how to hold the board next.

import { jpeg } from "../shared/live.js";
import { show } from "../shared/panel.js";
import { jpegs, StereoPanel } from "../shared/stereo_panel.js";

const PREVIEW = 640; // px of a view
const FRAMES = 4; // kept until their answers come
const FLASH_MS = 250;
const COVERED = "#2fb8ff38";
const CORNER = "#ff2d9b";
const DOT = 5; // px

export default (component) => show(Boards, component, view);

class Boards extends StereoPanel {
  frames = new Map();
  number = 0;
  flashing = false;

  begin(data) {
    super.begin(data);
    this.taken = data.taken;
  }

  async grab() {
    const wanted = this.frames.get(this.wanted);
    this.wanted = null;
    if (wanted) return { parts: await jpegs(wanted.views) };
    if (!this.isFresh()) return null;
    const at = performance.now();
    const views = this.views(this.picture(this.videos, 1));
    const preview = this.picture(views, Math.min(1, PREVIEW / views[0].width));
    const number = ++this.number;
    this.frames.set(number, { views, preview });
    this.frames.delete(number - FRAMES);
    return { at, header: { number, at }, parts: [await jpeg(preview)] };
  }

  answered(item) {
    this.wanted = item.wanted;
    this.taken = item;
    const shown = this.frames.get(item.number);
    if (shown) this.drawFrame(shown.preview, item);
    else this.flash();
    if (item.enough) this.finish();
  }

  // Shows that a pair was taken.
  flash() {
    this.flashing = true;
    setTimeout(() => {
      this.flashing = false;
      this.render();
    }, FLASH_MS);
  }

  stopped() {
    this.frames.clear();
  }

  finish() {
    this.stop();
    this.trigger("finished", performance.now());
  }

  // A frame, shaded where the board has been, with its corners.
  drawFrame(preview, { corners, outlines }) {
    const { width, height } = preview;
    const canvas = Object.assign(this.find("canvas"), { width, height });
    const context = canvas.getContext("2d");
    context.drawImage(preview, 0, 0);
    const place = ([x, y], view) => [((x + view) * width) / 2, y * height];
    context.fillStyle = COVERED;
    context.beginPath();
    for (const views of outlines) {
      views.forEach((outline, view) => {
        outline.forEach((one, at) => context[at ? "lineTo" : "moveTo"](...place(one, view)));
        context.closePath();
      });
    }
    context.fill();
    context.fillStyle = CORNER;
    corners.forEach((found, view) => {
      for (const one of found) {
        const [x, y] = place(one, view);
        context.fillRect(x - DOT / 2, y - DOT / 2, DOT, DOT);
      }
    });
  }
}
