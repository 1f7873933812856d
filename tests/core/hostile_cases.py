"""What a hostile file is, and who reads it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from stereolag.reading import read_calibration, read_disparity, read_image, read_matcher, read_signal

READ = "read"
"""The answer of a file that must be read; others are what the sentence that refuses it must hold."""

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
    """A file by name: who reads it, how it is made, and `READ` or a pattern of its refusal."""

    name: str
    reader: str
    make: Callable[[], bytes]
    answer: str
