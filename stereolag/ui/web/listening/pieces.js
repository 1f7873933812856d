// Sound of one or two microphones, in blocks from an AudioWorklet and in pieces of 16-bit samples.

import { clamp } from "../shared/numbers.js";

// Runs in the browser's audio thread, and delivers blocks of both channels.
const WORKLET = `
registerProcessor("blocks", class extends AudioWorkletProcessor {
  block = [new Float32Array(1024), new Float32Array(1024)];
  filled = 0;
  process([[first = new Float32Array(128), second = first]]) {
    this.block[0].set(first, this.filled);
    this.block[1].set(second, this.filled);
    this.filled = (this.filled + first.length) % 1024;
    if (!this.filled) this.port.postMessage(this.block);
    return true;
  }
});`;

// Unprocessed sound: the browser's processing for calls would change the lag, or suppress the sound as noise.
const MICROPHONE = { echoCancellation: false, noiseSuppression: false, autoGainControl: false, channelCount: { ideal: 2 } };

// Opens the channels of one device, or the first channel of each of two, and calls `take([first, second])` with each block.
export async function listening(run, deviceIds, take) {
  const media = [];
  for (const deviceId of deviceIds) media.push(await run.open("audio", deviceId, MICROPHONE));
  // At the rate of the device, if the browser names it, so that nothing is resampled.
  const { sampleRate } = media[0].getAudioTracks()[0].getSettings();
  const context = new AudioContext(sampleRate ? { sampleRate } : {});
  run.ends.push(() => context.close());
  const source = URL.createObjectURL(new Blob([WORKLET], { type: "text/javascript" }));
  await context.audioWorklet.addModule(source);
  URL.revokeObjectURL(source);
  // A device with one channel is heard in both; the server notices that they are equal.
  const node = new AudioWorkletNode(context, "blocks", { channelCount: 2, channelCountMode: "explicit" });
  node.port.onmessage = ({ data }) => take(data);
  const sources = media.map((one) => context.createMediaStreamSource(one));
  if (sources.length === 1) sources[0].connect(node);
  else {
    const both = context.createChannelMerger(2);
    sources.forEach((one, at) => one.connect(both, 0, at));
    both.connect(node);
  }
  node.connect(context.destination); // silent, but an unconnected node is not run
  await context.resume();
  return { rate: context.sampleRate, sources };
}

// The newest samples of both channels' blocks, `most` at most: two arrays of 16-bit samples, as bytes.
export const joined = (collected, most) => [0, 1].map((channel) => {
  const all = collected.flatMap((block) => [...block[channel]]).slice(-most);
  return new Uint8Array(Int16Array.from(all, (one) => clamp(Math.round(32768 * one), -32768, 32767)).buffer);
});
