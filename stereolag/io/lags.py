"""The lag between two recordings as files: its figures, its curve, and the recordings with the lag removed."""

from __future__ import annotations

import csv
import io
from typing import Any

import numpy as np
import numpy.typing as npt
import soundfile

from stereolag.core.searches import LagSearch
from stereolag.io.documents import figures_json
from stereolag.signals import SignalLag
from stereolag.signals.alignment import aligned, aligned_length

BLOCK = 2**20
"""Samples aligned and written at a time."""

WAV_BYTES = 2**32
"""A WAV file counts its bytes in 32 bits; two channels of 32-bit floats take 8 bytes per sample."""

WAV_RATES = (1, 500_000_000)
"""Whole sampling rates, Hz, for which a WAV file can also store its bytes per second."""


def lag_figures(result: SignalLag, search: LagSearch) -> dict[str, Any]:
    """Return the figures of a lag by name, as printed by ``stereolag lag --json``, and the settings of the search.

    The command adds ``recordings``: the facts about its files.
    """
    return {
        "command": "lag",
        "lag_samples": result.lag,
        "lag_subsample": result.lag_subsample,
        "time_s": result.time_s,
        "distance_m": result.distance_m,
        "score": result.score,
        "peak_ratio": result.peak_ratio,
        "ties": result.ties,
        "verdict": result.verdict,
        "reason": result.judgement.reason if result.judgement else None,
        "rivals": list(result.rivals),
        "inverted": result.inverted,
        "drift_ppm": result.drift_ppm,
        "uncertainty_samples": result.uncertainty,
        "elapsed_s": result.elapsed_s,
        "settings": search.model_dump(),
    }


def lag_json(result: SignalLag, search: LagSearch) -> str:
    """Return :func:`lag_figures` as an indented JSON document; a figure that is NaN or infinite is null."""
    return figures_json(lag_figures(result, search), indent=2) + "\n"


def curve_csv(result: SignalLag, sampling_rate: float, most: int | None = None) -> str:
    """Return the curve of a lag as CSV: ``lag_samples``, ``time_s`` and ``correlation``, by ascending lag.

    Every number has all its digits. The method "sampled" has ``votes`` in place of a correlation.

    Parameters
    ----------
    result
        The result of :func:`stereolag.signal_lag`.
    sampling_rate
        Samples per second.
    most
        Largest number of lags, taken around the lag found; all by default.
    """
    if result.lags is not None and result.correlation is not None:
        name, lags, heights = "correlation", np.asarray(result.lags), result.correlation
    else:
        votes = dict(sorted((result.votes or {}).items()))
        name, lags, heights = "votes", np.array([*votes], dtype=np.int64), np.array([*votes.values()], dtype=np.int64)
    if most is not None and lags.size > most:
        first = min(max(0, int(np.searchsorted(lags, result.lag)) - most // 2), lags.size - most)
        lags, heights = lags[first : first + most], heights[first : first + most]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["lag_samples", "time_s", name])
    table.writerows(zip(lags.tolist(), (lags / sampling_rate).tolist(), heights.tolist(), strict=True))
    return text.getvalue()


def aligned_wav(signal_1: npt.ArrayLike, signal_2: npt.ArrayLike, lag: int, sampling_rate: float) -> bytes:
    """Return both recordings as one stereo WAV of 32-bit floats, sensor 1 on the left, with the lag removed.

    Nothing is cut off: before a recording begins and after it ends, its mean takes its place. Values are kept unless
    one is outside -1..1, where players would clip it: then both recordings are divided by the largest.

    Parameters
    ----------
    signal_1, signal_2
        (N1,) and (N2,) finite numbers.
    lag
        Samples, positive where signal 2 hears the event later.
    sampling_rate
        Samples per second, rounded, since a WAV file stores a whole number.

    Raises
    ------
    ValueError
        As :func:`check_aligned_wav` does.
    """
    # They keep their type: a converted copy of an hour would take a gigabyte.
    first, second = np.asarray(signal_1), np.asarray(signal_2)
    check_aligned_wav(first.size, second.size, lag, sampling_rate)
    length = aligned_length(first.size, second.size, lag)
    loudest = max(1.0, *(max(float(signal.max()), -float(signal.min())) for signal in (first, second)))
    means = float(first.mean(dtype=np.float64)), float(second.mean(dtype=np.float64))
    stream = io.BytesIO()
    with soundfile.SoundFile(stream, "w", round(sampling_rate), 2, "FLOAT", format="WAV") as file:
        for start in range(0, length, BLOCK):
            part = aligned(first, second, lag, start, min(start + BLOCK, length), means=means)
            file.write((part / loudest).astype(np.float32))
    return stream.getvalue()


def check_aligned_wav(size_1: int, size_2: int, lag: int, sampling_rate: float) -> None:
    """Refuse recordings that :func:`aligned_wav` cannot store; far quicker than trying.

    Raises
    ------
    ValueError
        A sampling rate that a WAV file cannot store, or recordings too long for one.
    """
    lowest, highest = WAV_RATES
    if not lowest <= sampling_rate <= highest:
        raise ValueError(
            f"sampling_rate is {sampling_rate:g}; a WAV file holds {lowest} to {highest:,} samples a second."
        )
    most = WAV_BYTES // 8 - BLOCK
    length = aligned_length(size_1, size_2, lag)
    if length > most:
        raise ValueError(f"The aligned recordings have {length:,} samples; a stereo WAV file holds {most:,}.")
