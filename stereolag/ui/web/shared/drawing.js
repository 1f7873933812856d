// The panel of a component for drawing on a picture, which arrives separately.

import { placeIn } from "./dom.js";
import { eventOf, received } from "./exchange.js";
import { Panel } from "./panel.js";

export class DrawingPanel extends Panel {
  setUp() {
    this.listen(eventOf("drawn-on"), () => this.takePicture());
    this.atEnd(() => URL.revokeObjectURL(this.source));
  }

  begin(_) {
    this.takePicture();
  }

  // Shows the picture, now or as soon as it has arrived.
  takePicture() {
    const picture = received("drawn-on", this.data.name);
    if (!picture || picture === this.picture) return;
    this.picture = picture;
    URL.revokeObjectURL(this.source);
    this.source = URL.createObjectURL(new Blob(picture.parts));
    this.schedule();
  }

  // The row and column under a pointer, in fractions of a pixel.
  placeOf(event) {
    return placeIn(event, this.stage, this.data);
  }
}
