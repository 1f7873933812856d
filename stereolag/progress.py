"""How a long job tells how far it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[float], None]
"""Called with the fraction done, 0..1, at least ten times a second by a long job."""


def silent(fraction: float) -> None:
    """Ignore the progress: what a job calls when nobody asked."""


def part(progress: Progress, number: int, count: int) -> Progress:
    """Return the progress of one of several equal parts of a job, the first being number 0."""
    return lambda done: progress((number + done) / count)
