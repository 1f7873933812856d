// The reverse of stereolag.figures.template_by_hand.packed_search.

// The RGBA bytes of a PNG, untouched by any colour management.
async function pixels(bytes) {
  const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }), { colorSpaceConversion: "none" });
  const canvas = new OffscreenCanvas(image.width, image.height);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return { data: context.getImageData(0, 0, image.width, image.height).data, rows: image.height, cols: image.width, image };
}

async function decoded(data) {
  const length = new DataView(data.buffer, data.byteOffset).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(data.subarray(4, 4 + length)));
  const body = data.subarray(4 + length);
  const [picture, template, opaque, codes] = await Promise.all(
    header.parts.map(([start, size]) => pixels(body.subarray(start, start + size))),
  );
  const counts = Uint8Array.from({ length: opaque.rows * opaque.cols }, (_, at) => opaque.data[4 * at]);
  const scores = Float32Array.from({ length: codes.rows * codes.cols }, (_, at) => {
    const code = 256 * codes.data[4 * at] + codes.data[4 * at + 1];
    return code ? (code - 1) / header.steps - 1 : NaN;
  });
  for (let at = 0; at < counts.length; at++) template.data[4 * at + 3] = counts[at];
  return {
    ...header,
    picture,
    template: { ...prepared(template, counts), data: template.data },
    map: { rows: codes.rows, cols: codes.cols, scores },
  };
}
