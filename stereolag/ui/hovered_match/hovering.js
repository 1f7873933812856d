// Follows the crosshair of the pictures and explains the window under it, without server requests.

export default function (component) {
  return shown(Panel, component);
}

class Panel {
  constructor(parent) {
    const find = (selector) => parent.querySelector(selector);
    this.root = find(".hovered");
    this.reading = find(".reading");
    this.parts = {
      window: find(".window canvas"),
      above: find(".from-above canvas"),
      strip: find(".strip canvas"),
      frames: find(".strip svg"),
      curve: find(".curve"),
    };
    this.captions = [".window", ".from-above", ".search"].map((name) => find(`${name} figcaption`));
    this.at = null;
    this.onCross = ({ detail }) => detail.name === this.settings?.pictures && this.follow(detail.at);
    this.onPair = ({ detail }) => detail === this.settings?.pictures && this.schedule();
    window.addEventListener("stereolag-crosshair", this.onCross);
    window.addEventListener("stereolag-pair", this.onPair);
    this.resized = new ResizeObserver(() => this.schedule());
    this.resized.observe(this.root);
  }

  close() {
    window.removeEventListener("stereolag-crosshair", this.onCross);
    window.removeEventListener("stereolag-pair", this.onPair);
    this.resized.disconnect();
  }

  load(settings) {
    this.settings = settings;
    const { colours, words } = settings;
    this.root.style.setProperty("--window", colours.peak);
    this.root.style.setProperty("--curve", colours.curve);
    this.root.setAttribute("aria-label", words.title);
    this.captions.forEach((caption, at) => (caption.textContent = [words.window, words.above, words.axis][at]));
    this.schedule();
  }

  follow(at) {
    const left = this.at && !at;
    this.at = at;
    if (left) this.mark(window.stereolagMarks?.get(this.settings.pictures) ?? []);
    this.schedule();
  }

  // At most once per frame, however often the pointer moves.
  schedule() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = undefined;
      this.draw();
    });
  }

  draw() {
    const pair = window.stereolagPairs?.get(this.settings.pictures);
    // While a new pair is on its way, the previous one is still on the page for a moment.
    if (!pair || pair.digest !== this.settings.digest || !this.root.clientWidth) return;
    const { row, col } = this.at ?? this.settings.pixel;
    if (row >= pair.rows || col >= pair.cols) return;
    const seen = explained(pair, this.settings, row, col);
    const truth = pair.truth(row, col);
    const found = places(seen, truth, this.settings);
    cut(this.parts.window, pair.images[0], seen.start, seen.top, seen.size, seen.size);
    const across = drawStrip(this.parts, seen, found, pair);
    drawCurve(this.parts, seen, found, this.settings, across);
    drawFromAbove(this.parts, seen, found, this.settings);
    this.say(row, col, seen, found);
    if (this.at) this.mark(this.frames(seen, found));
  }

  say(row, col, seen, found) {
    const { words } = this.settings;
    const span = (className, text) => Object.assign(document.createElement("span"), { className, textContent: text });
    const listed = [...found].reverse().flatMap(({ name, colour, dy, dx, score }) => {
      const swatch = span("swatch", "");
      swatch.style.background = colour;
      const place = shortened(-dx, Number.isInteger(dx) ? 0 : 2, "px") + (dy ? `, ${shortened(Math.abs(dy), 0, "px")} ${dy > 0 ? words.down : words.up}` : "");
      const scored = Number.isNaN(score) ? "" : `: ${shortened(score, this.settings.score === "cross" ? 0 : 3)}`;
      return [" ", swatch, `${name} ${place}${scored}`];
    });
    const where = `${words.row} ${row}, ${words.column} ${col}: `;
    this.reading.replaceChildren(where, span("kind", words.kinds[seen.kind]), ...listed);
    this.parts.window.setAttribute("aria-label", `${words.window}: ${words.row} ${row}, ${words.column} ${col}`);
    for (const scores of [this.parts.above, this.parts.curve]) scores.setAttribute("aria-label", this.reading.textContent);
  }

  frames(seen, found) {
    const { top, start, size, asked } = seen;
    const { colours } = this.settings;
    const frame = (picture, row, col, height, width, colour, area = false, dashed = area) => ({
      row, col, height, width, colour, label: "", to: null, dashed, filled: area, pictures: [picture],
    });
    const height = asked.dy_last - asked.dy_first + size;
    const width = asked.dx_last - asked.dx_first + size;
    return [
      frame(1, top + asked.dy_first, start + asked.dx_first, height, width, colours.search, true),
      frame(0, top, start, size, size, colours.peak),
      ...found.map(({ dy, dx, colour }) => frame(1, top + dy, start + dx, size, size, colour, false, colour === colours.truth)),
    ];
  }

  mark(marks) {
    window.dispatchEvent(new CustomEvent("stereolag-marks", { detail: { name: this.settings.pictures, marks } }));
  }
}
