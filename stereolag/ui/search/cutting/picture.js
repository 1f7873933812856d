// Stores the bytes of a picture under its name for the component that draws on it, whichever is on the page first.
export default function ({ data }) {
  const length = data[0] + 256 * data[1];
  const name = new TextDecoder().decode(data.subarray(2, 2 + length));
  const pictures = (window.stereolagDrawnOn ??= new Map());
  pictures.set(name, data.slice(2 + length));
  for (const old of pictures.keys()) if (pictures.size > 4) pictures.delete(old);
  window.dispatchEvent(new CustomEvent("stereolag-drawn-on", { detail: name }));
}
