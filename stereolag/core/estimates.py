"""Estimates of the memory and time of a job, made before it starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stereolag.core.limits import limits

OVERHEAD = 16 * 2**20
"""Bytes that a job takes regardless of its size: thread stacks and workspaces, plans, tables."""

HEAP_BLOCK = 32 * 2**20
"""The C library's allocator (glibc) returns a freed block at once only if it is larger than this."""


@dataclass(frozen=True)
class Estimate:
    """Upper estimate of the memory and time of a job.

    Attributes
    ----------
    memory
        Bytes in addition to the inputs, including the result.
    seconds
        Rough run time on two otherwise idle cores, with the loops already compiled.
    """

    memory: int
    seconds: float


def check_memory(estimate: Estimate, what_fits: str | Callable[[int], str]) -> None:
    """Refuse a job before it starts if it would take more memory than one job may (:mod:`stereolag.core.limits`).

    Parameters
    ----------
    estimate
        Estimate for the job.
    what_fits
        A sentence about a job that would fit, or a function that returns it for the bytes allowed, called only if the
        job is refused.

    Raises
    ------
    ValueError
        The job is refused; the message states the estimate and the limit, followed by `what_fits`.
    """
    most = limits().job_memory
    if estimate.memory > most:
        sentence = what_fits if isinstance(what_fits, str) else what_fits(most)
        raise ValueError(
            f"This needs about {spoken(estimate.memory)} of memory, and one job may take {spoken(most)}. {sentence}"
        )


def largest_fitting(estimate: Callable[[int], Estimate], most: int, allowed: int) -> int:
    """Return the largest size from 0 to `most` whose estimate stays within the bytes allowed, found by bisection.

    0 means nothing at all and is not estimated. The returned size fits even if the estimate is not monotonic.
    """
    fits, too_large = 0, most + 1
    while too_large - fits > 1:
        middle = (fits + too_large) // 2
        if estimate(middle).memory <= allowed:
            fits = middle
        else:
            too_large = middle
    return fits


def kept_blocks(size: int, count: int) -> int:
    """Return how many bytes of `count` freed blocks of `size` bytes the allocator may keep."""
    return count * min(size, HEAP_BLOCK)


def rounded_down(number: int) -> int:
    """Return a number rounded down to two significant digits, for a sentence."""
    unit = int(10 ** max(0, len(str(number)) - 2))
    return number // unit * unit


def spoken(size: float) -> str:
    """Return a size in bytes as text in a suitable unit."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
