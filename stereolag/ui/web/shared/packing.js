// The inverse of stereolag.ui.components.

// The header, with the bytes of its parts; synchronous, since an awaited result would come only after all other work that
// a change causes on the page.
export function unpacked(data) {
  const length = new DataView(data.buffer, data.byteOffset).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(data.subarray(4, 4 + length)));
  const body = data.subarray(4 + length);
  return { ...header, parts: header.parts.map(([start, size]) => body.subarray(start, start + size)) };
}

// An item as stereolag.ui.streams takes one: a header, and parts that are arrays of bytes.
export function packed(header, parts = []) {
  let end = 0;
  const places = parts.map(({ length }) => {
    end += length;
    return [end - length, length];
  });
  const text = new TextEncoder().encode(JSON.stringify({ ...header, parts: places }));
  const data = new Uint8Array(4 + text.length + end);
  new DataView(data.buffer).setUint32(0, text.length, true);
  data.set(text, 4);
  parts.forEach((part, at) => data.set(part, 4 + text.length + places[at][0]));
  return data;
}

export const base64 = (bytes) => btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));

// The RGBA bytes of a PNG, and the image itself, without colour management.
export async function pixelsOf(bytes) {
  const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }), { colorSpaceConversion: "none" });
  const [rows, cols] = [image.height, image.width];
  const context = new OffscreenCanvas(cols, rows).getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return { rows, cols, image, data: context.getImageData(0, 0, cols, rows).data };
}

// The codes of 16 bits in red and green.
export function codesOf({ rows, cols, data }) {
  return Uint16Array.from({ length: rows * cols }, (_, at) => 256 * data[4 * at] + data[4 * at + 1]);
}

// Scores decoded from the colours they were sent as, NaN where there is no score.
export function scoresOf(picture, steps) {
  const scores = Float32Array.from(codesOf(picture), (code) => (code ? (code - 1) / steps - 1 : NaN));
  return { rows: picture.rows, cols: picture.cols, scores };
}
