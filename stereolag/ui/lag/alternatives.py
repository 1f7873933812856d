"""Text alternatives for the charts of the lag page, for screen readers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Vector
from stereolag.core.typography import typesets
from stereolag.signals import SignalLag
from stereolag.signals.drift import Drift
from stereolag.ui.sentences import duration


@typesets
def curve_in_words(result: SignalLag) -> str:
    """Return a description of the lag curve: where it is highest, and whether that peak stands alone."""
    if result.lags is None:
        votes = (result.votes or {}).get(result.lag, 0)
        return f"Votes for each lag: most of them, {votes:,}, are for lag {result.lag:,} samples."
    searched = f"Correlation at the lags {result.lags[0]:,} to {result.lags[-1]:,} samples"
    if result.judgement is None or result.verdict == "sure":
        return f"{searched}: one clear peak at {result.lag:,}, score {result.score:.3f}."
    if result.verdict == "ambiguous":
        return f"{searched}: highest at {result.lag:,}, and {len(result.rivals)} other peaks are about as high."
    return f"{searched}: nothing rises above chance level; the highest point is at {result.lag:,}."


@typesets
def waveforms_in_words(signal_1: Vector, signal_2: Vector, sampling_rate: float) -> str:
    """Return a description of the two recordings before alignment."""
    lengths = [
        f"{duration(signal.size / sampling_rate)} of sensor {name}" for signal, name in ((signal_1, 1), (signal_2, 2))
    ]
    return f"Loudness over time: {lengths[0]} above {lengths[1]}."


@typesets
def aligned_in_words(result: SignalLag) -> str:
    """Return how well the recordings match once the lag is undone."""
    return (
        f"Both recordings on one plot, the second moved back by {result.lag:,} samples: where they overlap, "
        f"their correlation is {result.score:.3f}."
    )


@typesets
def close_up_in_words(result: SignalLag, start: int) -> str:
    """Return a description of the close-up of the aligned samples."""
    return f"200 samples of both recordings from sample {start:,} on, the second moved back by {result.lag:,} samples."


@typesets
def drift_in_words(drift: Drift) -> str:
    """Return how the lag changes over time."""
    trend = f"rises by {drift.ppm:+.1f} ppm" if drift.shows else "does not change measurably"
    return f"Lag of {drift.blocks} blocks over time: it {trend}, {drift.start:,.1f} samples at first."


@typesets
def run_times_in_words(seconds: npt.NDArray[np.float64]) -> str:
    """Return how long the runs took."""
    shortest, median, longest = (duration(float(one)) for one in np.percentile(seconds, (0, 50, 100)))
    return f"Times of {seconds.size} runs: {shortest} to {longest}, median {median}."
