// Passes marks to the pictures they belong to, whichever of the two is on the page first.
export default function ({ data }) {
  const waiting = (window.stereolagMarks ??= new Map());
  waiting.set(data.name, data.marks);
  window.dispatchEvent(new CustomEvent("stereolag-marks", { detail: data }));
}
