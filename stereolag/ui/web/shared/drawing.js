// The panel of a component with which one draws on a picture; the picture arrives separately.

import { eventOf, received } from "./exchange.js";
import { Panel } from "./panel.js";

const KIND = "drawn-on";

export class DrawingPanel extends Panel {
  scale = 0; // px of the screen per px of the picture, 0 while there is no room

  setUp() {
    this.listen(eventOf(KIND), () => this.takePicture());
    this.watchSize(this.root);
    this.atEnd(() => URL.revokeObjectURL(this.source));
  }

  begin(_) {
    this.takePicture();
  }

  // Shows the picture, now or as soon as it has arrived.
  takePicture() {
    const picture = received(KIND, this.data.name);
    if (!picture || picture === this.picture) return;
    this.picture = picture;
    URL.revokeObjectURL(this.source);
    this.source = URL.createObjectURL(new Blob(picture.parts));
    this.schedule();
  }

  // To be overridden. The width and height, px, into which the picture is to fit.
  room() {
    return [0, 0];
  }

  draw() {
    const [width, height] = this.room();
    if (width) this.scale = Math.min(width / this.data.cols, height / this.data.rows);
    this.render();
  }

  // The row and column under a pointer, in fractions of a pixel.
  placeOf({ clientX, clientY }) {
    const { left, top } = this.stage.getBoundingClientRect();
    return [(clientY - top) / this.scale, (clientX - left) / this.scale];
  }

  // Some lengths of the picture, by their names in CSS.
  px(lengths) {
    return Object.entries(lengths).map(([name, length]) => `${name}: ${length * this.scale}px`).join("; ");
  }
}
