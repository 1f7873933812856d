"""How much one file and one job may take: set by whoever runs the app, in the environment."""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path, PurePosixPath

from pydantic import Field

from stereolag.settings import Settings, SettingsError

PREFIX = "STEREOLAG_"

_MOUNTED = Path("/sys/fs/cgroup")
_JOINED = Path("/proc/self/cgroup")
"""Where Linux keeps control groups, and tells a process which ones it is in."""


class Limits(Settings):
    """What is accepted; each can be set by an environment variable, ``STEREOLAG_MAX_MEGAPIXELS`` and so on."""

    # No less than the bundled examples take.
    max_megapixels: int = Field(default=50, description="Pixels of one image, millions.", ge=4, le=1000)
    max_megasamples: int = Field(
        default=320, description="Samples of one recording, all channels, millions.", ge=1, le=10_000
    )
    max_frames: int = Field(default=500_000, description="Frames of one sequence.", ge=1, le=100_000_000)
    max_video_s: int = Field(default=100_000, description="Length of one video, seconds.", ge=1, le=100_000_000)
    job_memory_mb: int | None = Field(
        default=None,
        description="Memory of one job, MB; unless set, and at the most, half of what the machine has.",
        ge=64,
    )

    @property
    def max_pixels(self) -> int:
        """Return the most pixels of one image."""
        return self.max_megapixels * 1_000_000

    @property
    def max_samples(self) -> int:
        """Return the most samples of one recording, over all channels."""
        return self.max_megasamples * 1_000_000

    @property
    def job_memory(self) -> int:
        """Return how many bytes one job may take."""
        half = machine_memory() // 2
        return half if self.job_memory_mb is None else min(half, self.job_memory_mb * 2**20)


_defaults: dict[str, int] = {}


def set_defaults(**values: int) -> None:
    """Set what holds where the environment says nothing: a server is stricter than a script on its owner's machine."""
    _defaults.update(values)
    limits.cache_clear()


@cache
def limits() -> Limits:
    """Return the limits in force, read from the environment once.

    Raises
    ------
    ValueError
        A variable that holds no number, or one out of its bounds; the error names it.
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
        # A variable cannot hold None: it is left unset.
        said = sentence.removeprefix(name).replace(" or None", "")
        raise ValueError(f"The environment variable {PREFIX}{name.upper()}{said}") from error


@cache
def machine_memory() -> int:
    """Return the memory of this machine, or less where a container or a service is allowed less, bytes."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else 8 * 2**30
    for file in _limit_files():
        try:
            total = min(total, int(file.read_text(encoding="ascii")))
        except (OSError, ValueError):  # no such file, or "max"
            continue
    return total


def _limit_files() -> Iterator[Path]:
    """Give the files with the memory limits of the control groups, versions 1 and 2, that this process is in.

    The limit of a container stands at the root of what it sees, that of a systemd service in a group below; the groups
    around a group limit it too.
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
