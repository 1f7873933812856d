// Passes outlines to the maps below them, whichever of the two is on the page first; removed with this component.
export default function ({ data }) {
  const outlines = (window.stereolagOutlines ??= new Map());
  const hand = (path) => {
    outlines.set(data.name, path);
    window.dispatchEvent(new CustomEvent("stereolag-outlines", { detail: data.name }));
  };
  hand(data.path);
  return () => hand("");
}
