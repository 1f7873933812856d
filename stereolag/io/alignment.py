"""Recording 2 on the clock of recording 1, as WAV and CSV files."""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt
import soundfile

from stereolag.core.arrays import Vector
from stereolag.signals import SignalLag
from stereolag.signals.alignment import BLOCK, aligned_blocks

WAV_BYTES = 2**32
"""A WAV file counts its bytes in 32 bits; 32-bit floats take 4 bytes per sample."""

WAV_RATES = (1, 500_000_000)
"""Whole sampling rates, Hz, for which a WAV file can also store its bytes per second."""


def write_aligned(
    file: Path | IO[bytes],
    suffix: str,
    signal_1: npt.ArrayLike,
    signal_2: npt.ArrayLike,
    lag: SignalLag | float,
    sampling_rate: float,
) -> None:
    """Write recording 2 on the clock of recording 1 (:func:`stereolag.align`), as long as recording 1.

    ``".wav"``: 32-bit floats; values are kept unless one is outside -1..1, where players would clip it: then all are
    divided by the largest. ``".csv"``: ``time_s`` from the first sample of recording 1 on, and ``recording_2``.

    Parameters
    ----------
    file
        A path, which is not opened if the lag is refused, or a binary file.
    suffix
        The format.
    signal_1, signal_2
        (N1,) and (N2,) finite numbers.
    lag
        The result for them, or a constant lag, samples.
    sampling_rate
        Samples per second; rounded in a WAV file, which stores a whole number.

    Raises
    ------
    ValueError
        A lag that is not sure, or at which the recordings do not overlap; and as :func:`check_wav`.
    """
    # They keep their type: a converted copy of an hour would take a gigabyte.
    first, second = np.asarray(signal_1), np.asarray(signal_2)
    rest = aligned_blocks(first, second, lag)
    blocks = itertools.chain([next(rest)], rest)
    if suffix == ".wav":
        check_wav(first.size, sampling_rate)
        loudest = max(1.0, float(second.max()), -float(second.min()))
        with soundfile.SoundFile(file, "w", round(sampling_rate), 1, "FLOAT", format="WAV") as sound:
            for block in blocks:
                sound.write((block / loudest).astype(np.float32))
    else:
        with file.open("wb") if isinstance(file, Path) else nullcontext(file) as table:
            _write_csv(table, blocks, sampling_rate)


def _write_csv(table: IO[bytes], blocks: Iterator[Vector], sampling_rate: float) -> None:
    table.write(b"time_s,recording_2\n")
    first = 0
    for block in blocks:
        seconds = np.arange(first, first + block.size) / sampling_rate
        np.savetxt(table, np.column_stack((seconds, block)), fmt="%.10g", delimiter=",")
        first += block.size


def aligned_file(
    suffix: str, signal_1: npt.ArrayLike, signal_2: npt.ArrayLike, lag: SignalLag | float, sampling_rate: float
) -> bytes:
    """Return the file that :func:`write_aligned` writes."""
    stream = io.BytesIO()
    write_aligned(stream, suffix, signal_1, signal_2, lag, sampling_rate)
    return stream.getvalue()


def check_wav(samples: int, sampling_rate: float) -> None:
    """Refuse an aligned recording that no WAV file holds; far quicker than trying.

    Raises
    ------
    ValueError
        A sampling rate that a WAV file cannot store, or more samples than one holds.
    """
    lowest, highest = WAV_RATES
    if not lowest <= sampling_rate <= highest:
        raise ValueError(
            f"sampling_rate is {sampling_rate:g}; a WAV file holds {lowest} to {highest:,} samples a second."
        )
    most = WAV_BYTES // 4 - BLOCK
    if samples > most:
        raise ValueError(f"The aligned recording has {samples:,} samples; a WAV file holds {most:,}.")
