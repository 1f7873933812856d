"""What one term of the matching cost is, and the run of pixels that its loop adds to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.stereo.semi_global.costs import MatchingCost

EightBit = npt.NDArray[np.uint8]
Volume = npt.NDArray[np.float64]


class Run(NamedTuple):
    """The pixels of one row that are worked on together: their costs stay in the processor's cache."""

    y: int
    first: int
    end: int
    """Columns `first` to `end`; the runs of a row follow one another."""
    is_top: bool
    """Whether this is the first row of its band."""
    lags: int
    origin: int
    """Where column 0 of the right image meets the first lag, in features without a border."""


class CostTerm(NamedTuple):
    """One term of the matching cost.

    Attributes
    ----------
    weight
        The field of :class:`stereolag.stereo.semi_global.costs.MatchingCost` that holds the most it costs.
    kind
        The type of its features, which tells compiled code which term they belong to.
    features
        Makes what is compared, of one image: a named tuple of arrays (H, W), or (H, W) within a border of the window's
        radius, and numbers; called with the image, the radius and the settings.
    add
        Compiled; called with the features of both images, a run, room for what is kept from one row of a band to the
        next, int32, and the costs of the run, float32, (pixels × lags), to which it adds its own.
    reference
        The plain formula: (H, W, W), the cost of each pixel of the left image with each of the same row of the right
        one; called with both images, the radius and the settings.
    """

    weight: str
    kind: type[Any]
    features: Callable[[EightBit, int, MatchingCost], Any]
    add: Callable[..., None]
    reference: Callable[[EightBit, EightBit, int, MatchingCost], Volume]
