"""Flicker of maps with and without steadying by the previous frame, and its effect on errors and time."""

from __future__ import annotations

import math
import time

import numpy as np

from benchmarks.pairs import DATA
from stereolag.samples import drives
from stereolag.sequences import (
    SequenceMemory,
    SequenceSettings,
    Steadiness,
    StereoSequence,
    example_sequence,
    open_sequence,
    run_sequence,
)
from stereolag.sequences.motion import motion_since, steadied
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import preset
from stereolag.stereo.opencv import StereoBM, StereoSGBM

KITTI = DATA / "sequences" / "kitti_seq1"
COLUMNS = ("flicker_px", "bad_2_percent", "epe_px")


def matchers(count: int) -> dict[str, StereoMatcher]:
    """Return the compared methods over a number of disparities."""
    found = {"fast": preset("fast"), "accurate": preset("accurate"), "bm": StereoBM(), "sgbm": StereoSGBM()}
    return {name: one.with_search_range(0, count) for name, one in found.items()}


def sequences() -> dict[str, tuple[StereoSequence, int]]:
    """Return the available drives, each with its number of disparities."""
    found: dict[str, tuple[StereoSequence, int]] = {}
    if KITTI.is_dir():
        found["KITTI, no truth"] = open_sequence(KITTI / "left", KITTI / "right"), 64
    try:
        example = next(iter(drives().values()))
    except FileNotFoundError:
        return found
    found["our example"] = example_sequence(example), example.num_disparities
    return found


def means(
    sequence: StereoSequence, methods: dict[str, StereoMatcher], steadiness: Steadiness | None
) -> dict[str, list[float]]:
    """Return the mean of every figure over all frames, by method; NaN if a figure is missing."""
    kept = SequenceMemory()
    run_sequence(sequence, methods, kept, settings=SequenceSettings(steadiness=steadiness))
    found = {}
    for method in methods:
        rows = [[getattr(one, name) for name in COLUMNS] for one in kept.records.values() if one.method == method]
        table = np.array(rows, float)
        found[method] = [float(np.nanmean(col)) if np.isfinite(col).any() else math.nan for col in table.T]
    return found


def milliseconds(sequence: StereoSequence, matcher: StereoMatcher, runs: int = 9) -> tuple[float, float]:
    """Return the median times of estimating the picture's motion and of steadying one map, ms."""
    frames = [sequence.frame(number) for number in (0, 1)]
    maps = [matcher.compute(frame.left, frame.right) for frame in frames]
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        motion = motion_since(frames[0].left, frames[1].left)
        middle = time.perf_counter()
        if motion is None:
            raise ValueError("The frames of the benchmark cannot be compared.")
        steadied(maps[0], maps[1], motion, Steadiness())
        times.append((middle - start, time.perf_counter() - middle))
    moved, made = np.median(np.array(times), axis=0) * 1e3
    return float(moved), float(made)


def steadiness_table() -> tuple[str, dict[str, object]]:
    """Return the table as Markdown, and its figures."""
    lines = [
        "| drive | method | flicker px | steady | wrong > 2 px, % | steady | error px | steady |",
        "|---" * 8 + "|",
    ]
    notes, figures = [], {}
    for name, (sequence, count) in sequences().items():
        methods = matchers(count)
        alone, steady = (means(sequence, methods, one) for one in (None, Steadiness()))
        for method in methods:
            cells = [f"{value:.3f}" for both in zip(alone[method], steady[method], strict=True) for value in both]
            lines.append(f"| {name} | {method} | {' | '.join(cells).replace('nan', '')} |")
        moved, made = milliseconds(sequence, methods["fast"])
        notes.append(
            f"{name}: {len(sequence)} frames; the motion of the picture {moved:.1f} ms, each map {made:.1f} ms"
        )
        figures[name] = {"alone": alone, "steady": steady, "motion_ms": moved, "map_ms": made}
    return "\n".join([*lines, "", "; ".join(notes) + "."]), dict(figures)
