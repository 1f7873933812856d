// Stores the pieces of a video for its player, whichever of the two is on the page first. The bytes of a piece follow
// the name of its video and its number.
const NAME = 32;

export default function ({ data }) {
  const videos = (window.stereolagVideos ??= new Map());
  const name = new TextDecoder().decode(data.subarray(0, NAME));
  const number = new DataView(data.buffer, data.byteOffset).getUint32(NAME, true);
  const pieces = videos.get(name) ?? [];
  if (pieces[number]) return;
  pieces[number] = data.slice(NAME + 4);
  videos.set(name, pieces);
  window.dispatchEvent(new CustomEvent("stereolag-video", { detail: name }));
}
