// Hands outlines to the maps they lie over, whichever of the two is on the page first; they go when this goes.
export default function ({ data }) {
  const outlines = (window.stereolagOutlines ??= new Map());
  const hand = (path) => {
    outlines.set(data.name, path);
    window.dispatchEvent(new CustomEvent("stereolag-outlines", { detail: data.name }));
  };
  hand(data.path);
  return () => hand("");
}
