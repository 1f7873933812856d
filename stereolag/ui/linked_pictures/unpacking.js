// From the bytes of a message to pictures and what can be read of them.

const NOTHING = -32768;

// The reverse of stereolag.figures.linked_pictures.packed.
function unpacked(data) {
  const length = new DataView(data.buffer, data.byteOffset).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(data.subarray(4, 4 + length)));
  const body = data.subarray(4 + length);
  return { header, part: ([start, size]) => body.subarray(start, start + size) };
}

// Values from their differences along each row; an Int16Array wraps around as they did.
async function inflated(bytes, cols) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const values = new Int16Array(await new Response(stream).arrayBuffer());
  for (let at = 1; at < values.length; at++) if (at % cols) values[at] += values[at - 1];
  return values;
}

async function decoded(picture, part) {
  const url = URL.createObjectURL(new Blob([part(picture.image)], { type: picture.type }));
  const image = new Image();
  image.src = url;
  const readings = Promise.all(
    picture.readings.map(async (reading) => ({ ...reading, values: await inflated(part(reading.values), reading.cols) })),
  );
  await image.decode();
  return { ...picture, url, readings: await readings };
}
