// Follows the crosshair of the pictures and explains the window under it, without server requests.

import { element } from "../shared/dom.js";
import { eventOf, received, tell } from "../shared/exchange.js";
import { shortened } from "../shared/numbers.js";
import { Panel, show } from "../shared/panel.js";
import { cut, drawCurve, drawFromAbove, drawStrip, places } from "./drawing.js";
import { pairOf } from "./pair.js";
import { explained } from "./scoring.js";

export default (component) => show(HoveredMatchPanel, component);

class HoveredMatchPanel extends Panel {
  constructor(parent) {
    super(parent, "hovered");
    this.reading = this.find(".reading");
    this.parts = {
      window: this.find(".window canvas"),
      above: this.find(".from-above canvas"),
      strip: this.find(".strip canvas"),
      frames: this.find(".strip svg"),
      curve: this.find(".curve"),
    };
    this.at = null;
    this.listen(eventOf("crosshair"), ({ detail }) => detail.name === this.settings?.pictures && this.follow(detail.at));
    this.listen(eventOf("pair"), ({ detail }) => detail.name === this.settings?.pictures && this.takePair());
    this.watchSize(this.root);
  }

  load(settings) {
    this.settings = settings;
    const { colours, words } = settings;
    this.colour({ window: colours.peak, curve: colours.curve });
    this.root.setAttribute("aria-label", words.title);
    [["window", words.window], ["from-above", words.above], ["search", words.axis]].forEach(([name, text]) => {
      this.find(`.${name} figcaption`).textContent = text;
    });
    this.takePair();
    this.schedule();
  }

  // Decodes the pair that belongs to the settings once, as soon as it has arrived.
  async takePair() {
    const item = received("pair", this.settings.pictures);
    if (!item || item === this.item) return;
    this.item = item;
    const pair = await pairOf(item);
    if (item !== this.item) return; // a newer pair overtook this one
    this.pair = pair;
    this.schedule();
  }

  follow(at) {
    const left = this.at && !at;
    this.at = at;
    if (left) this.mark(received("marks", this.settings.pictures)?.marks ?? []);
    this.schedule();
  }

  draw() {
    const { pair, settings } = this;
    // While a new pair is on its way, the previous one is still there for a moment.
    if (!pair || pair.digest !== settings.digest || !this.root.clientWidth) return;
    const { row, col } = this.at ?? settings.pixel;
    if (row >= pair.rows || col >= pair.cols) return;
    const seen = explained(pair, settings, row, col);
    const found = places(seen, pair.truth(row, col), settings);
    cut(this.parts.window, pair.images[0], seen.start, seen.top, seen.size, seen.size);
    const across = drawStrip(this.parts, seen, found, pair);
    drawCurve(this.parts.curve, seen, found, settings, across);
    drawFromAbove(this.parts.above, seen, found, settings);
    this.describe(row, col, seen, found);
    if (this.at) this.mark(this.frames(seen, found));
  }

  describe(row, col, seen, found) {
    const { words } = this.settings;
    const listed = [...found].reverse().flatMap(({ name, colour, dy, dx, score }) => {
      const swatch = element("span", "swatch");
      swatch.style.background = colour;
      const aside = dy ? `, ${shortened(Math.abs(dy), 0, "px")} ${dy > 0 ? words.down : words.up}` : "";
      const scored = Number.isNaN(score) ? "" : `: ${shortened(score, this.settings.score === "cross" ? 0 : 3)}`;
      return [" ", swatch, `${name} ${shortened(-dx, Number.isInteger(dx) ? 0 : 2, "px")}${aside}${scored}`];
    });
    const where = `${words.row} ${row}, ${words.column} ${col}`;
    this.reading.replaceChildren(`${where}: `, element("span", "kind", words.kinds[seen.kind]), ...listed);
    this.parts.window.setAttribute("aria-label", `${words.window}: ${where}`);
    for (const scores of [this.parts.above, this.parts.curve]) scores.setAttribute("aria-label", this.reading.textContent);
  }

  frames(seen, found) {
    const { top, start, size, asked } = seen;
    const { colours } = this.settings;
    const frame = (picture, row, col, height, width, colour, style = {}) => ({
      row, col, height, width, colour, label: "", to: null, dashed: false, filled: false, pictures: [picture], ...style,
    });
    const height = asked.dy_last - asked.dy_first + size;
    const width = asked.dx_last - asked.dx_first + size;
    return [
      frame(1, top + asked.dy_first, start + asked.dx_first, height, width, colours.search, { dashed: true, filled: true }),
      frame(0, top, start, size, size, colours.peak),
      ...found.map(({ dy, dx, colour }) => frame(1, top + dy, start + dx, size, size, colour, { dashed: colour === colours.truth })),
    ];
  }

  mark(marks) {
    tell("marks", { name: this.settings.pictures, item: { marks } });
  }
}
