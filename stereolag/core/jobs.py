"""Jobs: the limits that an operator sets, the cost of every method in one table, refusals, and progress."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path, PurePosixPath
from typing import TypeAlias

from pydantic import Field

from stereolag.core.settings import Settings, SettingsError

PREFIX = "STEREOLAG_"

_CGROUP_ROOT = Path("/sys/fs/cgroup")
"""Where Linux mounts its control groups."""

_OWN_CGROUPS = Path("/proc/self/cgroup")
"""The control groups that this process is in, on Linux."""


class Limits(Settings):
    """The limits; each can be set by an environment variable, ``STEREOLAG_MAX_MEGAPIXELS`` and so on."""

    # The lower bounds admit the bundled examples.
    max_megapixels: int = Field(default=50, description="Pixels of one image, millions.", ge=4, le=1000)
    max_megasamples: int = Field(
        default=320, description="Samples of one recording, all channels, millions.", ge=1, le=10_000
    )
    max_frames: int = Field(default=500_000, description="Frames of one sequence.", ge=1, le=100_000_000)
    max_video_s: int = Field(default=100_000, description="Length of one video, seconds.", ge=1, le=100_000_000)
    max_live_streams: int = Field(default=8, description="Live cameras and microphones at a time.", ge=1, le=1000)
    max_live_minutes: int = Field(default=30, description="Length of one live stream, minutes.", ge=1, le=10_000)
    max_live_fps: int = Field(default=30, description="Frames of one live stream answered in a second.", ge=1, le=240)
    max_live_megapixels: int = Field(default=4, description="Pixels of one live frame, millions.", ge=1, le=100)
    max_live_message_mb: int = Field(default=8, description="Size of one live message, MB.", ge=1, le=100)
    job_memory_mb: int | None = Field(
        default=None,
        description="Memory of one job, MB; by default, and at most, half of the machine's.",
        ge=64,
    )

    @property
    def max_pixels(self) -> int:
        """The largest number of pixels of one image."""
        return self.max_megapixels * 1_000_000

    @property
    def max_samples(self) -> int:
        """The largest number of samples of one recording, over all channels."""
        return self.max_megasamples * 1_000_000

    @property
    def job_memory(self) -> int:
        """The memory that one job may take, bytes."""
        half = machine_memory() // 2
        return half if self.job_memory_mb is None else min(half, self.job_memory_mb * 2**20)


_defaults: dict[str, int] = {}


def set_defaults(**values: int) -> None:
    """Set the limits for variables missing in the environment: a server is stricter than a script of its own user."""
    _defaults.update(values)
    limits.cache_clear()


@cache
def limits() -> Limits:
    """Return the limits in force, read from the environment once.

    Raises
    ------
    ValueError
        A variable that is not a number or is out of bounds; the error names it.
    """
    given: dict[str, int | str] = _defaults | {
        name: os.environ[variable]
        for name in Limits.model_fields
        if (variable := f"{PREFIX}{name.upper()}") in os.environ
    }
    try:
        return Limits.model_validate(given)
    except SettingsError as error:
        name, sentence = error.problems[0]
        # A variable cannot be None, only unset.
        predicate = sentence.removeprefix(name).replace(" or None", "")
        raise ValueError(f"The environment variable {PREFIX}{name.upper()}{predicate}") from error


@cache
def machine_memory() -> int:
    """Return the memory of this machine, or the lower limit of a container or service, bytes."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8 * 2**30
    for file in _limit_files():
        try:
            total = min(total, int(file.read_text(encoding="ascii")))
        except (OSError, ValueError):  # no such file, or "max"
            continue
    return total


def _limit_files() -> Iterator[Path]:
    """Yield the files with the memory limits of this process's control groups, versions 1 and 2.

    A container sees its own limit at the root, a systemd service in a group below; the limits of enclosing groups apply
    too.
    """
    try:
        lines = _OWN_CGROUPS.read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if not controllers:
            root, name = _CGROUP_ROOT, "memory.max"
        elif "memory" in controllers.split(","):
            root, name = _CGROUP_ROOT / "memory", "memory.limit_in_bytes"
        else:
            continue
        group = PurePosixPath(path)
        for enclosing in (group, *group.parents):
            yield root / enclosing.relative_to("/") / name


OVERHEAD = 18 * 2**20
"""Bytes that a job of any size takes: thread stacks, workspaces, plans and tables, and the spread between runs."""

MAX_HEAP_BLOCK = 32 * 2**20
"""Bytes; only freed blocks that are larger are returned at once by the C library's allocator (glibc)."""


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


@dataclass(frozen=True)
class Cost:
    """A row of :data:`COSTS`: the memory and time of a method for each unit of the quantities it depends on.

    Attributes
    ----------
    stages
        Bytes per unit, for each stage that may need the most memory: the largest sum counts.
    seconds
        Seconds per unit.
    freed
        {quantity: (bytes per unit, count)}: freed blocks of that size, which the allocator may keep.
    """

    stages: tuple[Mapping[str, float], ...]
    seconds: Mapping[str, float]
    freed: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    def estimate(self, **amounts: float) -> Estimate:
        """Return the estimate for the amount of every quantity in the row."""

        def total(per_unit: Mapping[str, float]) -> float:
            return sum(cost * amounts[quantity] for quantity, cost in per_unit.items())

        kept = sum(
            count * min(size * amounts[quantity], MAX_HEAP_BLOCK) for quantity, (size, count) in self.freed.items()
        )
        return Estimate(int(max(map(total, self.stages)) + kept) + OVERHEAD, total(self.seconds))


COSTS: Mapping[str, Cost] = {
    # Recordings. samples: of both; longest, shortest: of one; lags: searched; points: of a transform, and
    # turns: points * log2(points); judged: samples on which the verdict is based.
    # Spectra, twiddle factors and scratch vectors of two threads; later the curve, its lags and those that may tie
    # with the peak: at worst all whose overlap is at least half the longest, in seven vectors.
    "lag by fft": Cost(
        (
            {"samples": 16, "longest": 8},
            {"samples": 8, "points": 80},
            {"samples": 8, "points": 16, "lags": 16, "ties": 56},
            {"samples": 8, "lags": 16, "judged": 250},
        ),
        {"turns": 1.4e-8},
        {"points": (16, 3)},
    ),
    # Two rows, their scratch vectors and spectra, the sum; before that, a finiteness flag per sample.
    "lag by blocks": Cost(
        ({"points": 56, "longest": 1}, {"judged": 400}), {"turns": 3e-9, "samples": 2e-8}, {"points": (8, 2)}
    ),
    # Bands of both at a time, their transforms and copies; later the bound in cells, and the blocks around peaks.
    "lag by bands": Cost(
        ({"points": 152, "cells": 56, "blocks": 1}, {"longest": 1}, {"judged": 550}), {"turns": 3e-9, "samples": 8e-8}
    ),
    "lag by products": Cost(
        (
            {"samples": 16, "longest": 8},
            {"samples": 8, "lags": 16, "ties": 56},
            {"samples": 8, "lags": 16, "shortest": 16},
            {"samples": 8, "lags": 16, "judged": 250},
        ),
        {"samples": 1.5e-8, "products": 2.5e-10},
        {"longest": (8, 1)},
    ),
    # Means, scales and indices of the slices of both; six vectors while the longer recording is sorted by value.
    "lag by votes": Cost(
        ({"samples": 32, "longest": 48}, {"samples": 8, "judged": 250}),
        {"samples": 1.5e-8, "turns": 1.8e-8},
        {"longest": (8, 3)},
    ),
    # Templates. grey: bytes of luminance and contiguous copies; values: of the template; places: that are scored.
    # The template's deviations, the scores, its spectra and those of the tiles; then the arrays by which a place is
    # judged, twice if it is blurred, and the blocks by which partly hidden places are searched for.
    "template by fft": Cost(
        (
            {"grey": 1, "values": 8, "places": 4, "points": 8},
            {"grey": 1, "values": 280, "places": 4, "hidden": 1},
        ),
        {"turns": 1.2e-9, "hidden_values": 1e-9},
    ),
    # Sizes and angles: the maps of a reduced image, one for every thread, or the templates refined in a larger one.
    "template by poses": Cost(
        ({"grey": 1, "values": 280}, {"grey": 1, "values": 32, "coarse": 1}, {"grey": 1, "values": 32, "fine": 1}),
        {"turns": 1.2e-9, "searches": 0.8},
    ),
    # The image in float64 and its squares; the products and sums of every channel; the blocks, as above.
    "template by products": Cost(
        (
            {"grey": 1, "values": 16, "planes": 16, "pixels": 8},
            {"grey": 1, "values": 16, "planes": 8, "pixels": 8, "places": 56, "sums": 16},
            {"grey": 1, "values": 170, "places": 4, "hidden": 1},
        ),
        {"products": 2.8e-10, "hidden_values": 1e-9},
    ),
    # Marks for each place. More if no value is rare: such a search is refused once its places are counted.
    "template by pixels": Cost(({"grey": 1, "values": 170, "places": 3},), {"pixels": 4e-9}),
    # Float images that OpenCV allocates at one time, measured under a mask: the image, its squares, products.
    "template by OpenCV": Cost(({"values": 36},), {"pixels": 1e-7, "masked": 3e-7}),
    # Stereo pairs. grey: bytes of both grey images; finished: pixels of a map that is filtered or filled.
    # A map with its scores and reasons, three times.
    "stereo": Cost(({"pixels": 51},), {"pixels": 3.6e-7}),
    # Comparing: images with margins, the records of all windows, rows of column sums or batches of transforms;
    # the left-right check; writing the map; finishing it.
    "windows": Cost(
        (
            {"grey": 1, "prepared": 1, "records": 1, "seen": 4, "columns": 24, "batch": 1.25},
            {"grey": 1, "records": 1, "seen": 24},
            {"grey": 1, "records": 1, "windows": 2, "pixels": 17},
            {"grey": 1, "finished": 48},
        ),
        {"pixels": 1.2e-7, "products": 1.2e-10, "turns": 2.1e-9},
        {"pixels": (4, 3)},
    ),
    # A strip of the volume with its matches; fitting the valleys; finishing the map.
    "semi-global": Cost(
        (
            {"grey": 1, "matches": 20, "fronts": 12, "strip": 1},
            {"grey": 1, "matches": 20, "pixels": 70},
            {"grey": 1, "pixels": 88},
        ),
        {"pixels": 3.6e-7, "cells": 3e-9},
        {"pixels": (4, 8)},
    ),
    # Stretching other types to 8 bits; the rows of costs kept at a time, or all costs; the map.
    "StereoBM": Cost(
        ({"grey": 1, "stretched": 20}, {"grey": 1, "pixels": 4, "rows": 1}, {"grey": 1, "pixels": 20}),
        {"pixels": 6e-8, "cells": 2e-10},
        {"pixels": (4, 2)},
    ),
    "StereoSGBM": Cost(
        ({"grey": 1, "stretched": 20}, {"grey": 1, "pixels": 4, "rows": 2, "volume": 4}, {"grey": 1, "pixels": 20}),
        {"pixels": 6e-8, "cells": 2e-9, "volume": 2e-9},
        {"pixels": (4, 2)},
    ),
    # Frames, matches with their neighbouring scores, both flows, planes of the mean; doubles: pixels not of 8 bits.
    "flow": Cost(({"pixels": 260, "doubles": 64},), {"pixels": 5e-7}),
    # A pair's diagnosis: every value fitted to the other image's exposure, or texture in float64.
    "diagnosis": Cost(
        ({"values": 9, "copy": 1, "searches": 2**24}, {"pixels": 42, "copy": 1, "searches": 2**24}),
        {"searches": 0.4, "values": 4e-8, "pixels": 4e-8},
        {"pixels": (4, 2)},
    ),
}
"""The memory and time of every method; `tests/core/test_jobs.py` measures each."""


def check_memory(estimate: Estimate, hint: str = "") -> None:
    """Refuse a job before it starts if it would take more memory than one job may.

    Parameters
    ----------
    estimate
        Estimate for the job.
    hint
        A sentence about an alternative, if there is one.

    Raises
    ------
    ValueError
        The job is refused; the message states the estimate and the limit.
    """
    limit = limits().job_memory
    if estimate.memory > limit:
        refusal = (
            f"This needs about {format_bytes(estimate.memory)} of memory, and one job may take {format_bytes(limit)}."
        )
        raise ValueError(f"{refusal} {hint}".rstrip())


def format_bytes(size: float) -> str:
    """Return a size in bytes as text in a suitable unit."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"


Progress: TypeAlias = Callable[[float], None]
"""Called with the fraction done, 0..1, at least ten times a second by a long job."""


def silent(fraction: float) -> None:
    """Ignore the progress."""


def part(progress: Progress, number: int, count: int) -> Progress:
    """Return the progress of one of several equal parts of a job, the first being number 0."""
    return lambda done: progress((number + done) / count)


class Pulse:
    """A progress callback that can repeat its last fraction during a long step, so that the listener can cancel it."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._done, self._reported = 0.0, time.monotonic()

    def __call__(self, done: float) -> None:
        """Report a new fraction."""
        self._done, self._reported = done, time.monotonic()
        self._progress(done)

    def again(self) -> None:
        """Report the last fraction again, at most twenty times a second."""
        if time.monotonic() - self._reported > 0.05:
            self(self._done)
