// A mask as text: one bit per pixel, row by row, 1 where the template counts; base64.

const CHUNK = 0x8000;

// Packs `length` values, above 0 where painted over.
export function packed(painted, length) {
  const bytes = new Uint8Array(Math.ceil(length / 8));
  for (let at = 0; at < length; at++) if (!painted[at]) bytes[at >> 3] |= 0x80 >> (at & 7);
  let text = "";
  for (let at = 0; at < bytes.length; at += CHUNK) text += String.fromCharCode(...bytes.subarray(at, at + CHUNK));
  return btoa(text);
}

// Unpacks a mask to values that are 1 where painted over.
export function unpacked(text, length) {
  const bytes = atob(text);
  return Uint8Array.from({ length }, (_, at) => ((bytes.charCodeAt(at >> 3) >> (7 - (at & 7))) & 1 ? 0 : 1));
}
