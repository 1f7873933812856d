"""Long recordings: seconds and memory from four seconds to an hour, each in a process of its own."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag import signal_lag

RATE = 44_100
LENGTHS = {"4 s": 4, "1 min": 60, "10 min": 600, "1 h": 3600}
MAX_LAG = 10 * RATE
"""Samples: ten seconds; of the shortest recordings a tenth of their length."""


def noise(size: int, seed: int) -> npt.NDArray[np.float32]:
    """Return white noise, made piece by piece in the memory that it takes."""
    random, made = np.random.default_rng(seed), np.empty(size, dtype=np.float32)
    for start in range(0, size, 2**20):
        made[start : start + 2**20] = random.standard_normal(min(2**20, size - start), dtype=np.float32)
    return made


def pair(size: int, lag: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return two recordings of one sound, each with noise of its own as loud as the sound."""
    sound = noise(size + lag, 0)
    first, second = noise(size, 1), noise(size, 2)
    first += sound[lag:]
    second += sound[:size]
    return first, second


def measured(seconds: int, limited: bool) -> dict[str, Any]:
    """Return what one search took; called in a process of its own."""
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
    lines = [
        "| each recording | search | seconds | of the processor | peak, MB | recordings, MB | verdict | right |",
        "|---|---|---|---|---|---|---|---|",
    ]
    figures: dict[str, Any] = {}
    for name, seconds in (lengths or LENGTHS).items():
        for limited in (True, False):
            search = "max_lag" if limited else "every lag"
            command = [sys.executable, "-m", "benchmarks.long", str(seconds), str(int(limited))]
            root = Path(__file__).parents[1]
            done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True, timeout=600)
            one = figures[f"{name}, {search}"] = json.loads(done.stdout)
            cells = [f"{one['seconds']:.2f}", f"{one['processor_seconds']:.2f}", f"{one['peak_mb']:,.0f}"]
            cells += [f"{one['input_mb']:,.0f}", one["verdict"], "yes" if one["right"] else "no"]
            lines.append("| " + " | ".join([name, search, *cells]) + " |")
    note = (
        "White noise at 0 dB, 44.1 kHz, float32; `max_lag` is ten seconds, of 4 s and 1 min a tenth. The peak is that"
    )
    return "\n".join([*lines, "", note + " of the whole process, Python and the recordings included."]), figures


if __name__ == "__main__":
    print(json.dumps(measured(int(sys.argv[1]), bool(int(sys.argv[2])))))
