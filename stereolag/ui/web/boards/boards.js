// Takes pictures of a board with a stereo camera for a calibration: the server says which of the frames it wants in full
// size, and how to hold the board next.

import { say } from "../shared/dom.js";
import { jpeg } from "../shared/live.js";
import { show } from "../shared/panel.js";
import { jpegs, StereoPanel } from "../shared/stereo_panel.js";

const PREVIEW = 640; // px of a view
const FRAMES = 4; // kept until their answers come
const FLASH_MS = 250;
const COVERED = "#2fb8ff38";
const CORNER = "#ff2d9b";
const DOT = 5; // px

export default (component) => show(Boards, component);

class Boards extends StereoPanel {
  constructor(parent) {
    super(parent, "boards");
    this.canvas = this.find("canvas");
    this.frames = new Map();
    this.number = 0;
    this.find(".finish").addEventListener("click", () => this.finish());
    this.find(".restart").addEventListener("click", () => this.trigger("restarted", performance.now()));
  }

  begin(data) {
    super.begin(data);
    for (const name of ["finish", "restart"]) this.find(`.${name}`).textContent = data.words[name];
    for (const name of ["picture", "size", "tilt"]) this.find(`.${name}`).previousElementSibling.textContent = data.words[name];
    this.canvas.setAttribute("aria-label", data.words.shown);
    this.showTaken(data.taken);
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
    this.showTaken(item);
    const shown = this.frames.get(item.number);
    if (shown) this.draw(shown.preview, item);
    else this.flash();
    if (item.enough) this.finish();
  }

  // Shows that a pair was taken.
  flash() {
    this.canvas.classList.add("flash");
    setTimeout(() => this.canvas.classList.remove("flash"), FLASH_MS);
  }

  stopped() {
    this.frames.clear();
  }

  finish() {
    this.stop();
    this.trigger("finished", performance.now());
  }

  showTaken({ said, board, count, progress, ready }) {
    const { words } = this.data;
    say(this.find(".said"), said);
    this.find(".board").textContent = board;
    this.find(".count").textContent = words[["none", "one"][count] ?? "several"].replace("{count}", count);
    for (const name of ["picture", "size", "tilt"]) this.find(`.${name}`).value = progress[name] ?? 0;
    this.find(".finish").disabled = !ready;
    this.find(".restart").hidden = !count;
  }

  // A frame, shaded where the board has been, with its corners.
  draw(preview, { corners, outlines }) {
    const { width, height } = preview;
    Object.assign(this.canvas, { width, height });
    const context = this.canvas.getContext("2d");
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
