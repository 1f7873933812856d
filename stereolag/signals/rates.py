"""The sampling rate of two recordings: as given, or as stored with them."""

from __future__ import annotations

from numbers import Real

import numpy as np

AUDIO_RATE = 44_100.0
"""Samples per second if neither the caller nor a recording gives a rate."""


def common_rate(signal_1: object, signal_2: object, given: float | None) -> float:
    """Return the sampling rate of both recordings, samples per second.

    Parameters
    ----------
    signal_1, signal_2
        Arrays, or recordings with a `sampling_rate` of their own, which may be None.
    given
        The requested rate; None: the rate of the recordings, or 44,100 if neither has one.

    Raises
    ------
    ValueError
        A rate that is not positive and finite, two recordings with different rates, or a given rate that differs from a
        recording's.
    """
    if given is not None:
        check_positive(given, "sampling_rate", "samples per second")
    named = (("signal_1", signal_1), ("signal_2", signal_2))
    own = {name: rate for name, signal in named if (rate := _own_rate(signal)) is not None}
    if len(set(own.values())) > 1:
        raise ValueError(
            f"signal_1 has {own['signal_1']:,.10g} Hz and signal_2 {own['signal_2']:,.10g} Hz; a lag is measured at "
            "one rate: resample one of them (`Recording.resampled`)."
        )
    for name, rate in own.items():
        check_positive(rate, f"the sampling_rate of {name}", "samples per second")
        if given is not None and rate != given:
            raise ValueError(
                f"sampling_rate is {given:,.10g} Hz and {name} has {rate:,.10g} Hz; leave sampling_rate out, or give "
                "the samples alone (`channels[0]`)."
            )
    if given is not None:
        return float(given)
    return next(iter(own.values()), AUDIO_RATE)


def check_positive(value: float, name: str, unit: str) -> None:
    """Raise a ValueError for a number that is not positive and finite."""
    if not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name} is {value!r} {unit}; it must be a positive, finite number.")


def _own_rate(signal: object) -> float | None:
    rate = getattr(signal, "sampling_rate", None)
    return float(rate) if isinstance(rate, Real) else None
