"""What flat means: a window that holds nothing to correlate, or nothing that sums can tell from nothing."""

from __future__ import annotations

FLAT_TEXTURE = 1e-6
"""Standard deviation, grey levels of 255, up to which a window holds nothing to correlate, tested or not."""

FLAT_WHOLE = 0.25
"""Energy about the mean up to which a window of whole numbers is flat: the least that is not 0 is a half."""

FLAT_SHARE = 1e-11
"""Energy per pixel, as a share of the largest pixel squared, that float64 sums cannot tell from none."""


def flat_energy(count: int, brightest: float, *, exact: bool) -> float:
    """Return the energy, the sum of squared deviations, up to which a window of `count` pixels is flat.

    Parameters
    ----------
    count
        How many pixels.
    brightest
        The largest absolute value of the images.
    exact
        Whether the sums are of whole numbers, and none is rounded.
    """
    return FLAT_WHOLE if exact else FLAT_SHARE * count * brightest**2
