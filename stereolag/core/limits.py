"""Limits on one file and one job, set in the environment by the operator of the app."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path, PurePosixPath

from pydantic import Field

from stereolag.core.settings import Settings, SettingsError

PREFIX = "STEREOLAG_"

_MOUNTED = Path("/sys/fs/cgroup")
_JOINED = Path("/proc/self/cgroup")
"""Linux's control groups, and the list of those that a process is in."""


class Limits(Settings):
    """The limits; each can be set by an environment variable, ``STEREOLAG_MAX_MEGAPIXELS`` and so on."""

    # The lower bounds admit the bundled examples.
    max_megapixels: int = Field(default=50, description="Pixels of one image, millions.", ge=4, le=1000)
    max_megasamples: int = Field(
        default=320, description="Samples of one recording, all channels, millions.", ge=1, le=10_000
    )
    max_frames: int = Field(default=500_000, description="Frames of one sequence.", ge=1, le=100_000_000)
    max_video_s: int = Field(default=100_000, description="Length of one video, seconds.", ge=1, le=100_000_000)
    job_memory_mb: int | None = Field(
        default=None,
        description="Memory of one job, MB; by default, and at most, half of the machine's.",
        ge=64,
    )

    @property
    def max_pixels(self) -> int:
        """Return the largest number of pixels of one image."""
        return self.max_megapixels * 1_000_000

    @property
    def max_samples(self) -> int:
        """Return the largest number of samples of one recording, over all channels."""
        return self.max_megasamples * 1_000_000

    @property
    def job_memory(self) -> int:
        """Return the memory that one job may take, bytes."""
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
        said = sentence.removeprefix(name).replace(" or None", "")
        raise ValueError(f"The environment variable {PREFIX}{name.upper()}{said}") from error


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

    A container's limit is at the root of its own view, a systemd service's in a group below; enclosing groups apply
    their limits too.
    """
    try:
        lines = _JOINED.read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        return
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if not controllers:
            root, name = _MOUNTED, "memory.max"
        elif "memory" in controllers.split(","):
            root, name = _MOUNTED / "memory", "memory.limit_in_bytes"
        else:
            continue
        group = PurePosixPath(path)
        for around in (group, *group.parents):
            yield root / around.relative_to("/") / name
