"""Long recordings: time and memory from four seconds to an hour, each in its own process."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from stereolag import signal_lag

Samples: TypeAlias = npt.NDArray[np.float32]

PIECE_SAMPLES = 2**20
RATE = 44_100
LENGTHS = {"4 s": 4, "1 min": 60, "10 min": 600, "1 h": 3600}
MAX_LAG = 10 * RATE
"""Ten seconds, in samples; for the shortest recordings a tenth of their length is used."""

NOTE = (
    "White noise at 0 dB, 44.1 kHz, float32; `max_lag` is ten seconds, of 4 s and 1 min a tenth. The peak is that of "
    "the whole process, Python and the recordings included."
)


def noise(size: int, seed: int) -> Samples:
    """Return white noise, generated piecewise to need no extra memory."""
    random, made = np.random.default_rng(seed), np.empty(size, dtype=np.float32)
    for start in range(0, size, PIECE_SAMPLES):
        made[start : start + PIECE_SAMPLES] = random.standard_normal(min(PIECE_SAMPLES, size - start), dtype=np.float32)
    return made


def pair(size: int, lag: int) -> tuple[Samples, Samples]:
    """Return two recordings of one sound, each with its own noise as loud as the sound, using no extra memory."""
    first, second = noise(size, 1), noise(size, 2)
    random = np.random.default_rng(0)
    for start in range(0, size + lag, PIECE_SAMPLES):
        sound = random.standard_normal(min(PIECE_SAMPLES, size + lag - start), dtype=np.float32)
        for recording, place in ((first, start - lag), (second, start)):
            begin, stop = max(0, place), min(size, place + sound.size)
            if begin < stop:
                recording[begin:stop] += sound[begin - place : stop - place]
    return first, second


def measured(seconds: int, limited: bool) -> dict[str, Any]:
    """Return the time and memory of one search; called in its own process."""
    size = seconds * RATE
    max_lag = min(MAX_LAG, size // 10) if limited else None
    lag = (max_lag or size) // 4
    warm = noise(300_000, 3)
    signal_lag(warm, warm, max_lag=30)
    given = pair(size, lag)
    before = resource.getrusage(resource.RUSAGE_SELF)
    start = time.perf_counter()
    found = signal_lag(*given, max_lag=max_lag)
    elapsed = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_SELF)
    return {
        "seconds": elapsed,
        "processor_seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        "peak_mb": after.ru_maxrss / 1024,
        "input_mb": sum(signal.nbytes for signal in given) / 2**20,
        "verdict": found.verdict,
        "right": found.lag == lag,
    }


def long_table(lengths: dict[str, int] | None = None) -> tuple[str, dict[str, Any]]:
    """Return the table as Markdown, and its figures."""
    figures: dict[str, Any] = {}
    for name, seconds in (lengths or LENGTHS).items():
        for limited in (True, False):
            command = [sys.executable, "-m", "benchmarks.long", str(seconds), str(int(limited))]
            root = Path(__file__).parents[1]
            done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True, timeout=600)
            figures[f"{name}, {'max_lag' if limited else 'every lag'}"] = json.loads(done.stdout)
    return as_markdown(figures), figures


def as_markdown(figures: dict[str, Any]) -> str:
    """Return the table of the figures."""
    lines = [
        "| each recording | search | seconds | of the processor | peak, MB | recordings, MB | verdict | right |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, one in figures.items():
        cells = [f"{one['seconds']:.2f}", f"{one['processor_seconds']:.2f}", f"{one['peak_mb']:,.0f}"]
        cells += [f"{one['input_mb']:,.0f}", one["verdict"], "yes" if one["right"] else "no"]
        lines.append("| " + " | ".join([*name.split(", "), *cells]) + " |")
    return "\n".join([*lines, "", NOTE])


if __name__ == "__main__":
    print(json.dumps(measured(int(sys.argv[1]), bool(int(sys.argv[2])))))
