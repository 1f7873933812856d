// Microphones in place of those of the machine, whose sound is made from a seed.
() => {
  const SECONDS = 4;
  const fake = (window.fake = { lag: 37, level: 0.2, clock: 1, channels: 2, asked: [], streams: [] });
  const noise = (size) => {
    let state = 7;
    return Float32Array.from({ length: size }, () => (state = (Math.imul(state, 1664525) + 1013904223) | 0) / 2 ** 31);
  };
  fake.play = (one) => {
    const { context, destination } = one;
    const size = SECONDS * context.sampleRate;
    const buffer = context.createBuffer(2, size, context.sampleRate);
    const sound = noise(size);
    for (let at = 0; at < size; at++) {
      buffer.getChannelData(0)[at] = fake.level * sound[at];
      buffer.getChannelData(1)[at] = fake.level * sound[(at - fake.lag + size) % size];
    }
    one.playing?.stop();
    one.playing = Object.assign(context.createBufferSource(), { buffer, loop: true });
    if (one === fake.streams.at(-1)) one.playing.playbackRate.value = fake.clock;
    one.playing.connect(destination);
    one.playing.start();
  };
  fake.change = (changes) => {
    Object.assign(fake, changes);
    fake.streams.forEach(fake.play);
  };
  navigator.mediaDevices.getUserMedia = async ({ audio }) => {
    fake.asked.push(audio);
    const context = new AudioContext();
    const destination = new MediaStreamAudioDestinationNode(context, { channelCount: fake.channels });
    const one = { context, destination };
    fake.streams.push(one);
    fake.play(one);
    return destination.stream;
  };
  navigator.mediaDevices.enumerateDevices = async () =>
    ["One", "Two"].map((label) => ({ kind: "audioinput", deviceId: label.toLowerCase(), label, groupId: "" }));
}
