// The panel of a component with which one draws on a picture; the picture arrives separately.

import { eventOf, received } from "./exchange.js";
import { Panel } from "./panel.js";

const KIND = "drawn-on";

export class DrawingPanel extends Panel {
  constructor(parent, name) {
    super(parent, name);
    this.image = this.find("img");
    this.listen(eventOf(KIND), () => this.showPicture());
    this.watchSize(this.root);
  }

  close() {
    super.close();
    URL.revokeObjectURL(this.image.src);
  }

  // Shows the picture of this name, now or as soon as it has arrived.
  showPicture(name = this.name) {
    this.name = name;
    const picture = received(KIND, name);
    if (!picture || picture === this.picture) return;
    this.picture = picture;
    URL.revokeObjectURL(this.image.src);
    this.image.src = URL.createObjectURL(new Blob(picture.parts));
  }

  // Makes the stage as large as fits into this many px; false while there is no room.
  fitStage(width, height) {
    const { rows, cols } = this.data;
    if (!width) return false;
    this.scale = Math.min(width / cols, height / rows);
    Object.assign(this.stage.style, { width: `${cols * this.scale}px`, height: `${rows * this.scale}px` });
    return true;
  }

  // The row and column under a pointer, in fractions of a pixel.
  placeOf({ clientX, clientY }) {
    const { left, top } = this.stage.getBoundingClientRect();
    return [(clientY - top) / this.scale, (clientX - left) / this.scale];
  }
}
