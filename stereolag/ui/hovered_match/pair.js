// Both images of a pair in grey and its ground truth, for the panel that follows the pointer.
// They are sent separately: a changed setting or a click then costs a few bytes, and the images are kept.

const TRUTH_SCALE = 64;
const TRUTH_ZERO = 512;

// The red and green of a PNG's pixels, without colour management.
async function planes(bytes) {
  const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }), { colorSpaceConversion: "none" });
  const canvas = new OffscreenCanvas(image.width, image.height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, image.width, image.height);
  const [red, green] = [new Uint8Array(data.length / 4), new Uint8Array(data.length / 4)];
  for (let at = 0; at < red.length; at++) [red[at], green[at]] = [data[4 * at], data[4 * at + 1]];
  return { image, red, green };
}

async function decoded(data) {
  const length = new DataView(data.buffer, data.byteOffset).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(data.subarray(4, 4 + length)));
  const part = ([start, size]) => data.subarray(4 + length + start, 4 + length + start + size);
  const [left, right, truth] = await Promise.all(
    [header.left, header.right, header.truth].map((place) => place && planes(part(place))),
  );
  const { rows, cols } = header;
  return {
    name: header.name,
    digest: header.digest,
    rows,
    cols,
    left: left.red,
    right: right.red,
    images: [left.image, right.image],
    deviation: deviation(left.red),
    truth: (row, col) => {
      const code = truth ? truth.red[row * cols + col] * 256 + truth.green[row * cols + col] : 0;
      return code ? code / TRUTH_SCALE - TRUTH_ZERO : NaN;
    },
  };
}

function deviation(values) {
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  return Math.sqrt(values.reduce((sum, value) => sum + (value - mean) ** 2, 0) / values.length);
}

let latest = 0;

export default async function ({ data }) {
  const turn = ++latest;
  const pair = await decoded(data);
  if (turn !== latest) return; // a newer pair overtook this one
  (window.stereolagPairs ??= new Map()).set(pair.name, pair);
  window.dispatchEvent(new CustomEvent("stereolag-pair", { detail: pair.name }));
}
