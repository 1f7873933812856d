// Microphones in place of those of the machine, whose sound is made from a seed.
() => {
  const SECONDS = 4;
  const LAG = 37;
  const fake = (window.fake = { channels: 2, asked: [], streams: [] });
  const noise = (size) => {
    let state = 7;
    return Float32Array.from({ length: size }, () => (state = (Math.imul(state, 1664525) + 1013904223) | 0) / 2 ** 31);
  };
  const play = ({ context, destination }) => {
    const size = SECONDS * context.sampleRate;
    const buffer = context.createBuffer(2, size, context.sampleRate);
    const sound = noise(size);
    for (let at = 0; at < size; at++) {
      buffer.getChannelData(0)[at] = 0.2 * sound[at];
      buffer.getChannelData(1)[at] = 0.2 * sound[(at - LAG + size) % size];
    }
    const playing = Object.assign(context.createBufferSource(), { buffer, loop: true });
    playing.connect(destination);
    playing.start();
  };
  navigator.mediaDevices.getUserMedia = async ({ audio }) => {
    fake.asked.push(audio);
    const context = new AudioContext();
    const destination = new MediaStreamAudioDestinationNode(context, { channelCount: fake.channels });
    const one = { context, destination };
    fake.streams.push(one);
    play(one);
    return destination.stream;
  };
  navigator.mediaDevices.enumerateDevices = async () =>
    ["One", "Two"].map((label) => ({ kind: "audioinput", deviceId: label.toLowerCase(), label, groupId: "" }));
}
