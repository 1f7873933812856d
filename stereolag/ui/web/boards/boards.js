// Takes pictures of a board with a stereo camera for a calibration: the server says which frames it wants in full size,
// and how to hold the board next.

import { cut } from "../shared/dom.js";
import { jpeg } from "../shared/live.js";
import { jpegs, StereoPanel } from "../shared/stereo_panel.js";

const PREVIEW = 640; // width of a view, px
const FLASH_MS = 250; // of the frame's edge when a pair is taken

export default class Boards extends StereoPanel {
  wanted = null; // the views of a frame that the server wants in full size
  corners = []; // of the board in both views of the frame shown

  begin(data) {
    super.begin(data);
    this.taken = data.taken;
  }

  async grab() {
    const { wanted } = this;
    this.wanted = null;
    if (wanted) return { parts: await jpegs(wanted) };
    if (!this.isFresh()) return null;
    const at = performance.now();
    const views = this.views(this.picture(this.media, 1));
    const preview = this.picture(views, Math.min(1, PREVIEW / views[0].width));
    return { at, header: { at }, parts: [await jpeg(preview)], views, preview };
  }

  answered(item, { views, preview }) {
    this.wanted = item.wanted ? views : null;
    this.taken = item;
    if (preview) {
      this.corners = item.corners;
      cut(this.find("canvas"), preview);
    } else this.find(".shown").animate({ outlineColor: Array(2).fill("var(--st-primary-color)") }, FLASH_MS);
    if (item.enough) this.finish();
  }

  stopped() {
    this.wanted = null;
  }

  finish() {
    this.stop();
    this.trigger("finished", performance.now());
  }
}
