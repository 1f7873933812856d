// Sound of one or two microphones in pieces of 16 bits, as an AudioWorklet delivers them.

import { opened } from "../shared/live.js";

const BLOCK = 1024; // samples that the worklet delivers at a time

// Runs in the browser's audio thread: both channels of a block, each sample in 16 bits.
const WORKLET = `
registerProcessor("blocks", class extends AudioWorkletProcessor {
  begin() {
    this.block = new Int16Array(2 * ${BLOCK});
    this.filled = 0;
  }
  process([[first, second = first]]) {
    if (!this.block) this.begin();
    const size = first ? first.length : 128;
    for (let at = 0; first && at < size; at++) {
      this.block[this.filled + at] = Math.max(-32768, Math.min(32767, Math.round(32768 * first[at])));
      this.block[${BLOCK} + this.filled + at] = Math.max(-32768, Math.min(32767, Math.round(32768 * second[at])));
    }
    this.filled += size;
    if (this.filled === ${BLOCK}) {
      this.port.postMessage(this.block, [this.block.buffer]);
      this.begin();
    }
    return true;
  }
});`;

// A microphone as it hears: what the browser does for calls would change the lag, or take the sound for noise.
const microphone = (deviceId) => navigator.mediaDevices.getUserMedia({
  audio: {
    ...(deviceId && { deviceId: { exact: deviceId } }),
    echoCancellation: false, noiseSuppression: false, autoGainControl: false, channelCount: { ideal: 2 },
  },
});

// Opens the channels of one device, or the first channel of each of two, and calls `take(first, second)` with each block.
export async function listening(deviceIds, take) {
  const media = [];
  try {
    for (const deviceId of deviceIds) media.push(await microphone(deviceId));
    return await blocks(media, take);
  } catch (error) {
    for (const one of media) opened(one).close();
    throw error;
  }
}

async function blocks(media, take) {
  // At the rate of the device, if the browser tells it: samples of its own, not resampled ones.
  const { sampleRate } = media[0].getAudioTracks()[0].getSettings();
  const context = new AudioContext(sampleRate ? { sampleRate } : {});
  const source = URL.createObjectURL(new Blob([WORKLET], { type: "text/javascript" }));
  await context.audioWorklet.addModule(source);
  URL.revokeObjectURL(source);
  // A device of one channel is heard in both; the server notices that they are alike.
  const node = new AudioWorkletNode(context, "blocks", { channelCount: 2, channelCountMode: "explicit" });
  node.port.onmessage = ({ data }) => take(data.subarray(0, BLOCK), data.subarray(BLOCK));
  const sources = media.map((one) => context.createMediaStreamSource(one));
  if (sources.length === 1) sources[0].connect(node);
  else {
    const both = context.createChannelMerger(2);
    sources.forEach((one, at) => one.connect(both, 0, at));
    both.connect(node);
  }
  node.connect(context.destination); // silent, but what leads nowhere is not run
  await context.resume();
  const heard = opened(new MediaStream(media.flatMap((one) => one.getTracks())));
  const stop = heard.close;
  const close = () => {
    stop();
    void context.close();
  };
  return Object.assign(heard, { rate: context.sampleRate, sources, close });
}

// The newest samples of blocks of both channels, `most` at most: two arrays, as bytes.
export const joined = (collected, most) => [0, 1].map((channel) => {
  const all = Int16Array.from(collected.flatMap((block) => [...block[channel]]).slice(-most));
  return new Uint8Array(all.buffer);
});
