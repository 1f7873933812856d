"""The type of a hostile file, and the readers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from stereolag.io.calibrations import read_calibration
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.io.recordings import read_signal
from stereolag.io.settings import read_matcher

READ = "read"
"""The answer for a file that must be read; any other answer is a pattern that the refusal must match."""

MB = 2**20

READERS: dict[str, Callable[[bytes], object]] = {
    "image": read_image,
    "signal": read_signal,
    "disparity": read_disparity,
    "disparity ÷ 4": partial(read_disparity, divisor=4),
    "calibration": read_calibration,
    "matcher": read_matcher,
}


@dataclass(frozen=True)
class HostileFile:
    """A named file: its reader, a function that makes it, and `READ` or a pattern of its refusal."""

    name: str
    reader: str
    make: Callable[[], bytes]
    answer: str
