// The reverse of stereolag.figures.packing.packed_pictures.

// The header and the RGBA bytes of each picture, without colour management.
async function unpacked(data) {
  const length = new DataView(data.buffer, data.byteOffset).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(data.subarray(4, 4 + length)));
  const body = data.subarray(4 + length);
  const pictures = await Promise.all(header.parts.map(([start, size]) => pixels(body.subarray(start, start + size))));
  return { header, pictures };
}

async function pixels(bytes) {
  const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }), { colorSpaceConversion: "none" });
  const [rows, cols] = [image.height, image.width];
  const context = new OffscreenCanvas(cols, rows).getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  image.close();
  return { rows, cols, data: context.getImageData(0, 0, cols, rows).data };
}

// Scores decoded from the colours they were sent as, NaN where there is no score.
function scoresOf({ rows, cols, data }, steps) {
  const scores = Float32Array.from({ length: rows * cols }, (_, at) => {
    const code = 256 * data[4 * at] + data[4 * at + 1];
    return code ? (code - 1) / steps - 1 : NaN;
  });
  return { rows, cols, scores };
}

const filled = (text, values) => text.replace(/\{(\w+)\}/g, (_, name) => values[name]);
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

// Draws RGBA bytes on a canvas of their size.
function put(canvas, data, rows, cols) {
  if (canvas.width !== cols || canvas.height !== rows) [canvas.width, canvas.height] = [cols, rows];
  canvas.getContext("2d").putImageData(new ImageData(data, cols, rows), 0, 0);
}
