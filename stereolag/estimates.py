"""What a job will take, told before it starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stereolag.limits import limits

OVERHEAD = 16 * 2**20
"""Bytes that a job takes whatever its size: stacks and workspaces of threads, plans, tables."""

HEAP_BLOCK = 32 * 2**20
"""The C library's allocator (glibc) gives a freed block back at once only if it is larger than this."""


@dataclass(frozen=True)
class Estimate:
    """What a job will take at the most.

    Attributes
    ----------
    memory
        Bytes beyond its inputs, its result included.
    seconds
        How long it will roughly take on two cores of which nobody else asks anything, its loops compiled already.
    """

    memory: int
    seconds: float


def check_memory(estimate: Estimate, what_fits: str | Callable[[int], str]) -> None:
    """Refuse a job before it starts where it would take more memory than one job may (:mod:`stereolag.limits`).

    Parameters
    ----------
    estimate
        What the job will take.
    what_fits
        A sentence that tells what would fit, or a function that makes it of the bytes allowed; it is called only
        where the job is refused.

    Raises
    ------
    ValueError
        It would; the sentence names the estimate, the limit and what would fit.
    """
    most = limits().job_memory
    if estimate.memory > most:
        sentence = what_fits if isinstance(what_fits, str) else what_fits(most)
        raise ValueError(
            f"This needs about {spoken(estimate.memory)} of memory, and one job may take {spoken(most)}. {sentence}"
        )


def largest_fitting(estimate: Callable[[int], Estimate], most: int, allowed: int) -> int:
    """Return the largest size from 0 to `most` whose estimate stays within the bytes allowed, found by bisection.

    0 stands for nothing at all and is not estimated. What is returned fits even where the estimate does not grow
    with every step of the size.
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
    """Return how many bytes of `count` freed blocks of `size` bytes the allocator may still hold."""
    return count * min(size, HEAP_BLOCK)


def rounded_down(number: int) -> int:
    """Return a number of which only the first two digits are not 0, for a sentence."""
    unit = int(10 ** max(0, len(str(number)) - 2))
    return number // unit * unit


def spoken(size: float) -> str:
    """Return a size in bytes with the unit that suits it."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
