// Takes pictures of a board with a stereo camera for a calibration: the server says which of the frames it wants in full
// size, and how to hold the board next.

import { cut, line } from "../shared/dom.js";
import { jpeg } from "../shared/live.js";
import { show } from "../shared/panel.js";
import { jpegs, StereoPanel } from "../shared/stereo_panel.js";

const PREVIEW = 640; // px of a view
const FRAMES = 4; // kept until their answers come
const FLASH_MS = 250;

export default (component) => show(Boards, component, view);

class Boards extends StereoPanel {
  frames = new Map();
  number = 0;
  flashing = false;
  corners = []; // of the board in both views of the frame shown

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
    if (shown) {
      this.corners = item.corners;
      cut(this.find("canvas"), shown.preview, 0, 0, shown.preview.width, shown.preview.height);
    } else this.flash();
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

  // The paths of where the board has been and of its corners; a view is a square of 1000.
  get covered() {
    return this.taken.outlines.flatMap((views) => views.map((outline, view) => `${line(placed(outline, view))}Z`)).join("");
  }

  get dots() {
    return this.corners.flatMap((found, view) => placed(found, view).map((one) => `${line([one])}h0`)).join("");
  }
}

const placed = (places, view) => places.map(([x, y]) => [1000 * (x + view), 1000 * y]);
