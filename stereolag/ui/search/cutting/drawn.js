// Common to the components that draw on a picture that was sent separately.

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

// Shows a picture in an <img> as soon as it has arrived.
class SentPicture {
  constructor(image) {
    this.image = image;
    this.hear = ({ detail }) => detail === this.name && this.show();
    window.addEventListener("stereolag-drawn-on", this.hear);
  }

  await(name) {
    if (name === this.name) return;
    this.name = name;
    this.show();
  }

  show() {
    const bytes = window.stereolagDrawnOn?.get(this.name);
    if (!bytes) return;
    URL.revokeObjectURL(this.image.src);
    this.image.src = URL.createObjectURL(new Blob([bytes]));
  }

  close() {
    window.removeEventListener("stereolag-drawn-on", this.hear);
    URL.revokeObjectURL(this.image.src);
  }
}
