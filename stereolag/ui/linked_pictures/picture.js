// Stores the bytes of a picture for its viewer, whichever of the two is on the page first. The key is the digest that
// precedes them.
const DIGEST = 64;
const held = new WeakMap();

export default function ({ data, parentElement }) {
  const pictures = (window.stereolagPictures ??= new Map());
  const digest = new TextDecoder().decode(data.subarray(0, DIGEST));
  const before = held.get(parentElement);
  if (digest !== before) {
    held.set(parentElement, digest);
    const one = pictures.get(digest) ?? { data: data.subarray(DIGEST), holders: 0 };
    one.holders += 1;
    pictures.set(digest, one);
    if (before) release(pictures, before);
    window.dispatchEvent(new CustomEvent("stereolag-picture", { detail: { digest, before } }));
  }
  return () => {
    if (!held.has(parentElement)) return;
    release(pictures, held.get(parentElement));
    held.delete(parentElement);
  };
}

function release(pictures, digest) {
  const one = pictures.get(digest);
  if (one && !(one.holders -= 1)) pictures.delete(digest);
}
