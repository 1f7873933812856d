"""Make the bundled pairs of recordings: ``python tools/recordings.py`` writes ``assets/signals``.

Each pair is one long sound scene recorded twice, in two windows of 176,401 samples, so the true
lag is known exactly: ``signal_1[i] == signal_2[i + lag]`` before each sensor adds noise of its own.

coast
    Surf, gulls, a speedboat passing and one stroke of a bell; nothing repeats. Sensor 2 hears it
    50,082 samples after sensor 1. The sensor noise is 50 dB below the scene.
harbour
    Two ships sound their horns. Sensor 2 hears it first (a negative lag) with less than half the
    gain, and both sensors add noise as strong as the scene (0 dB). The horns are placed to fool
    two naive methods, as the tests check:

    - *Circular correlation* (no zero padding). The first and the last horn are the loudest, and
      only one sensor hears each. Shifted by ``HORN_SPACING`` both meet the moment when the ships
      sound together; shifted a full recording further, the two remaining horns meet. A linear
      correlation keeps these coincidences at two lags, each below the true peak; wrapped around,
      they add up to a higher one.
    - *Lining up the loudest moments*: the loudest horn differs between the recordings.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

Signal = NDArray[np.float64]

SIGNALS = Path(__file__).parents[1] / "assets" / "signals"
SAMPLING_RATE = 44_100
SAMPLES = 176_401
SPEED_OF_SOUND = 340.0
PEAK = 10 ** (-3 / 20)

COAST_LAG = 50_082
HARBOUR_LAG = -31_234
HORN_SPACING = 93_500


def seconds(samples: int) -> Signal:
    return np.arange(samples) / SAMPLING_RATE


def decibels(level: float) -> float:
    return float(10 ** (level / 20))


def rms(signal: Signal) -> float:
    return float(np.sqrt(np.mean(signal**2)))


def shaped_noise(samples: int, rng: np.random.Generator, gain: Callable[[Signal], Signal]) -> Signal:
    """Return Gaussian noise of unit RMS whose amplitude spectrum follows ``gain(frequency in Hz)``."""
    frequency = np.fft.rfftfreq(samples, 1 / SAMPLING_RATE)
    spectrum = np.fft.rfft(rng.standard_normal(samples)) * gain(frequency)
    noise = np.fft.irfft(spectrum, samples)
    return noise / rms(noise)


def band(low: float, high: float) -> Callable[[Signal], Signal]:
    """Return a smooth band-pass between two frequencies in Hz."""
    return lambda frequency: 1 / np.sqrt((1 + (low / np.maximum(frequency, 1e-3)) ** 4) * (1 + (frequency / high) ** 4))


def swell(time: Signal, crest: float, rise: float, fall: float) -> Signal:
    """Return a bump of height 1 at ``crest``, with separate widths (s) before and after it."""
    width = np.where(time < crest, rise, fall)
    return np.exp(-(((time - crest) / width) ** 2))


def surf(samples: int, crests: list[float], rng: np.random.Generator) -> Signal:
    """Return waves that roar as they rise, and hiss as they run up the beach a little later."""
    time = seconds(samples)
    roar = shaped_noise(samples, rng, band(90, 700))
    hiss = shaped_noise(samples, rng, band(1200, 6000))
    sound = 0.15 * roar + 0.05 * hiss
    for crest in crests:
        sound += swell(time, crest, 0.55, 0.45) * roar
        sound += 0.7 * swell(time, crest + 0.3, 0.3, 0.75) * hiss
    return sound


def gull(start: float, length: float, pitch: float, samples: int) -> Signal:
    """Return one "kee-ow": a rough voice of ten harmonics whose pitch (Hz) jumps up and then falls."""
    time = seconds(samples) - start
    sounding = (time >= 0) & (time < length)
    progress = time[sounding] / length
    contour = pitch * (0.75 + 0.55 * np.exp(-(((progress - 0.22) / 0.28) ** 2)) - 0.15 * progress)
    phase = 2 * np.pi * np.cumsum(contour) / SAMPLING_RATE
    formant = [np.exp(-(((k * pitch - 2800) / 1900) ** 2)) for k in range(1, 11)]
    voice = sum(a * np.sin(k * phase) for k, a in enumerate(formant, start=1))
    rough = 1 + 0.4 * np.sin(2 * np.pi * 67 * time[sounding])
    cry = np.zeros(samples)
    cry[sounding] = voice * rough * np.sin(np.pi * progress) ** 0.6
    return cry / np.max(np.abs(cry))


def speedboat(samples: int, closest: float, rng: np.random.Generator) -> Signal:
    """Return an outboard that revs up while it passes: delayed, loudest when closest, with a Doppler shift.

    Every stroke differs a little, as those of real cylinders do, so no stretch repeats.
    """
    time = seconds(samples)
    distance = np.hypot(9.0, 17.0 * (time - closest))
    sent = time - distance / SPEED_OF_SOUND
    clock = np.linspace(sent[0], sent[-1], samples)
    revs = 62 + 55 * swell(clock, closest + 0.9, 1.5, 0.6) + 5 * np.sin(2 * np.pi * 0.9 * clock)
    strokes = np.interp(sent, clock, np.cumsum(revs) * (clock[1] - clock[0]))
    strokes += 0.03 * np.cumsum(rng.standard_normal(samples)) / np.sqrt(SAMPLING_RATE)
    tone = sum(k**-0.8 * np.sin(2 * np.pi * k * strokes + k * k) for k in range(1, 25))
    firing = np.exp(-6 * (strokes % 1)) * shaped_noise(samples, rng, band(300, 3500))
    vigour = np.interp(strokes, np.arange(1000), rng.uniform(0.6, 1.4, 1000))
    sound = (0.5 * tone + 1.6 * firing) * vigour * 9.0 / distance
    return sound / np.max(np.abs(sound))


def bell(samples: int, start: float, pitch: float, rng: np.random.Generator) -> Signal:
    """Return a bell buoy struck once: inharmonic partials, the high ones decaying fastest, and the impact."""
    time = seconds(samples) - start
    ringing = time >= 0
    heard = time[ringing]
    partials = [0.5, 1.0, 1.19, 1.5, 2.0, 2.51, 2.66, 3.01, 4.1, 5.43, 6.8]
    tone = sum(
        ratio**-0.5
        * np.exp(-heard * (1.1 + 0.9 * ratio))
        * np.sin(2 * np.pi * pitch * ratio * heard + rng.uniform(0, 2 * np.pi))
        for ratio in partials
    )
    clack = np.exp(-heard * 220) * rng.standard_normal(heard.size)
    stroke = np.zeros(samples)
    stroke[ringing] = (tone + 0.8 * clack) * -np.expm1(-heard * 2500)
    return stroke / np.max(np.abs(stroke))


def horn(pitches: tuple[float, float], rng: np.random.Generator) -> Signal:
    """Return one blast of 0.34 s: two brassy notes (Hz) that slide in, with breath. Unit energy."""
    samples = int(0.34 * SAMPLING_RATE)
    time = seconds(samples)
    notes = sum(
        k**-0.55 * np.sin(2 * np.pi * k * pitch * (time - 0.012 * np.exp(-time / 0.05)) + k)
        for pitch in pitches
        for k in range(1, 19)
    )
    breath = shaped_noise(samples, rng, band(900, 7000))
    envelope = -np.expm1(-time / 0.02) * -np.expm1(-(time[-1] - time) / 0.04)
    blast = (notes + 0.6 * breath) * envelope
    return blast / np.linalg.norm(blast)


def coast_scene(rng: np.random.Generator) -> Signal:
    samples = SAMPLES + COAST_LAG
    cries = [(0.35, 0.42, 1150), (1.42, 0.36, 1010), (1.83, 0.30, 1090), (2.16, 0.47, 960)]
    cries += [(3.5, 0.33, 1240), (4.18, 0.45, 1050)]
    scene = 0.075 * surf(samples, [1.15, 3.75], rng)
    scene += 0.45 * speedboat(samples, 3.05, rng)
    scene += 0.6 * bell(samples, 2.62, 587.0, rng)
    for start, length, pitch in cries:
        scene += rng.uniform(0.2, 0.3) * gull(start, length, pitch, samples)
    return scene


def harbour_scene(rng: np.random.Generator) -> Signal:
    """Return quiet water, a boat and two gulls under five blasts of two horns (see the module's docstring).

    With the energy of one soft blast as the unit, the true peak of a linear correlation is
    4 blasts + 0.5 of the quiet scene = 4.5; the loud blasts reach 2 + 2 = 4 at HORN_SPACING,
    and 1 more, 5, where a circular correlation wraps around.
    """
    samples = SAMPLES - HARBOUR_LAG
    quiet = 0.8 * surf(samples, [0.9, 2.3, 3.6], rng)
    quiet += 0.35 * speedboat(samples, 2.0, rng)
    quiet += 0.6 * gull(1.5, 0.4, 1100, samples) + 0.5 * gull(3.25, 0.45, 980, samples)
    scene = quiet * np.sqrt(0.5) / np.linalg.norm(quiet)
    ferry, tug = horn((277.2, 349.2), rng), horn((196.0, 233.1), rng)
    first, second = 4_400, 41_900
    together, last = first + HORN_SPACING, first + 2 * HORN_SPACING
    fourth = second + SAMPLES - HORN_SPACING
    blasts = [(first, 2 * ferry), (second, ferry), (together, ferry + tug)]
    for start, blast in [*blasts, (fourth, ferry), (last, 2 * tug)]:
        scene[start : start + blast.size] += blast
    return scene


def hear(scene: Signal, lag: int) -> tuple[Signal, Signal]:
    """Cut both sensors' windows out of one scene; a positive lag means that sensor 2 hears it later."""
    early, late = scene[:SAMPLES], scene[abs(lag) : abs(lag) + SAMPLES]
    return (late, early) if lag > 0 else (early, late)


def add_noise(signal: Signal, level: float, rng: np.random.Generator) -> Signal:
    """Add sensor noise, ``level`` dB relative to the signal; like wind noise it falls with frequency."""
    noise = shaped_noise(signal.size, rng, lambda frequency: 1 / np.sqrt(40 + frequency))
    return signal + noise * rms(signal) * decibels(level)


def write_pair(name: str, signals: tuple[Signal, Signal], gains: tuple[float, float]) -> list[str]:
    """Write both recordings as 16-bit FLAC, the louder one peaking at -3 dBFS."""
    scaled = [gain * signal for signal, gain in zip(signals, gains, strict=True)]
    loudest = max(float(np.max(np.abs(signal))) for signal in scaled)
    files = [f"{name}_1.flac", f"{name}_2.flac"]
    for file, signal in zip(files, scaled, strict=True):
        soundfile.write(SIGNALS / file, signal * PEAK / loudest, SAMPLING_RATE, subtype="PCM_16")
    return files


def make_coast() -> dict[str, object]:
    rng = np.random.default_rng(50_082)
    signal_1, signal_2 = hear(coast_scene(rng), COAST_LAG)
    noisy = add_noise(signal_1, -50, rng), add_noise(signal_2, -50, rng)
    return {
        "name": "coast",
        "title": "Coast",
        "description": "Surf, gulls, a speedboat and a bell buoy, heard by two sensors along a "
        "beach. Which of them hears it first, and how far apart are they?",
        "files": write_pair("coast", noisy, (1.0, 1.0)),
        "true_lag_samples": COAST_LAG,
        "sampling_rate": SAMPLING_RATE,
        "speed": 333.0,
    }


def make_harbour() -> dict[str, object]:
    rng = np.random.default_rng(31_234)
    signal_1, signal_2 = hear(harbour_scene(rng), HARBOUR_LAG)
    noisy = add_noise(signal_1, 0, rng), add_noise(signal_2, 0, rng)
    return {
        "name": "harbour",
        "title": "Harbour in the wind",
        "description": "Two ships sound their horns again and again; the wind is as loud as the "
        "scene, and sensor 2 has less than half the gain of sensor 1. The repeated horns fool a "
        "circular correlation: are you fooled too?",
        "files": write_pair("harbour", noisy, (1.0, 0.45)),
        "true_lag_samples": HARBOUR_LAG,
        "sampling_rate": SAMPLING_RATE,
        "speed": SPEED_OF_SOUND,
    }


def main() -> None:
    SIGNALS.mkdir(parents=True, exist_ok=True)
    pairs = [make_coast(), make_harbour()]
    (SIGNALS / "recordings.json").write_text(json.dumps(pairs, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
