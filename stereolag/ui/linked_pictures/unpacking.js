// From the bytes of a picture to its pixels and what can be read of them.

const NOTHING = -32768;

// The reverse of stereolag.figures.linked_pictures.packed.
async function decoded(data) {
  const length = new DataView(data.buffer, data.byteOffset).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(data.subarray(4, 4 + length)));
  const body = data.subarray(4 + length);
  const part = ([start, size]) => body.subarray(start, start + size);
  const [image, ...readings] = await Promise.all([
    header.image && decodedImage(part(header.image), header.type),
    ...header.readings.map(async (one) => ({ ...one, values: await inflated(part(one.values), one.cols) })),
  ]);
  return { image, readings };
}

async function decodedImage(bytes, type) {
  const image = new Image();
  image.src = URL.createObjectURL(new Blob([bytes], { type }));
  await image.decode();
  return image;
}

// Values from their differences along each row; an Int16Array wraps around as they did.
async function inflated(bytes, cols) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const values = new Int16Array(await new Response(stream).arrayBuffer());
  for (let at = 1; at < values.length; at++) if (at % cols) values[at] += values[at - 1];
  return values;
}

// A map in the colours that all maps share, as a canvas.
function painted({ values, cols, quantum }, { low, high, palette, none }) {
  const ramp = Uint32Array.from({ length: 256 }, (_, at) => pixelOf(palette.slice(6 * at, 6 * at + 6)));
  const table = new Uint32Array(65536).fill(pixelOf(none.slice(1)));
  const scale = 255 / (high - low);
  for (let value = NOTHING + 1; value < 32768; value++) {
    table[value - NOTHING] = ramp[Math.round(clamp((value * quantum - low) * scale, 0, 255))];
  }
  const canvas = element("canvas");
  [canvas.width, canvas.height] = [cols, values.length / cols];
  const context = canvas.getContext("2d");
  const image = context.createImageData(canvas.width, canvas.height);
  const pixels = new Uint32Array(image.data.buffer);
  for (let at = 0; at < values.length; at++) pixels[at] = table[values[at] - NOTHING];
  context.putImageData(image, 0, 0);
  return canvas;
}

// rrggbb as the four bytes of an opaque pixel, the first of them lowest.
function pixelOf(colour) {
  const rgb = parseInt(colour, 16);
  return ((0xff << 24) | ((rgb & 0xff) << 16) | (rgb & 0xff00) | (rgb >> 16)) >>> 0;
}
