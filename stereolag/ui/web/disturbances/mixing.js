// Two recordings of one sound and their disturbances: noise, repetition, an echo, drifting clocks.

import { dot, sumOf } from "./statistics.js";

const TAPS = 16;

// The parts with their samples, which are sent as Base64 of signed bytes.
export function withSamples(parts) {
  const bytes = (text) => Int8Array.from(atob(text), (character) => character.charCodeAt(0));
  return { ...parts, fresh: bytes(parts.fresh), pattern: bytes(parts.pattern), noises: parts.noises.map(bytes) };
}

// The sound: white noise, partly repeated every `period` samples, then smoothed recursively; of variance 1.
function soundOf({ fresh, pattern, softness, settling }, { repetition, period }) {
  const [once, again] = [Math.sqrt(1 - repetition), Math.sqrt(repetition)];
  let before = 0;
  const soft = Float64Array.from(fresh, (value, i) => (before = softness * before + once * value + again * pattern[i % period]));
  const sound = soft.subarray(settling);
  const mean = sumOf(sound) / sound.length;
  const deviation = Math.sqrt(dot(sound, sound) / sound.length - mean ** 2);
  return sound.map((value) => (value - mean) / deviation);
}

// The sound between two samples, interpolated by a sinc under a raised cosine.
function between(sound, place) {
  const whole = Math.floor(place);
  const part = place - whole;
  if (!part) return sound[whole];
  const sine = Math.sin(Math.PI * part) / Math.PI;
  let sum = 0;
  for (let k = 1 - TAPS; k <= TAPS; k++) {
    const distance = part - k;
    const weight = 0.5 + 0.5 * Math.cos((Math.PI * distance) / (TAPS + 1));
    sum += ((k % 2 ? -sine : sine) / distance) * weight * sound[whole + k];
  }
  return sum;
}

// `noise` in dB relative to the sound, `repetition` 0..1, `period` in samples, `echo` relative to the direct sound,
// `drift` in samples from the first to the last, `draw` the number of the noise.
export function mixed(parts, settings) {
  const { samples, lag, echo_delay: delay, before, noises } = parts;
  const sound = soundOf(parts, settings);
  const late = Float64Array.from({ length: samples + delay }, (_, i) =>
    between(sound, before + i - delay - lag - settings.drift * ((i - delay) / samples - 0.5)),
  );
  const loudness = 10 ** (settings.noise / 20);
  // Another draw shifts each noise by a different step, so that the two never combine as before.
  const noise = (number, i) => (loudness * noises[number][(i + settings.draw * [1237, 2741][number]) % samples]) / parts.unit;
  return [
    Float64Array.from({ length: samples }, (_, i) => sound[before + i] + noise(0, i)),
    Float64Array.from({ length: samples }, (_, i) => late[i + delay] + settings.echo * late[i] + noise(1, i)),
  ];
}
