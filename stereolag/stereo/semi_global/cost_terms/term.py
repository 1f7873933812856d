"""Interface of a term of the matching cost, and the run of pixels that its loop works on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereolag.stereo.semi_global.costs import MatchingCost

EightBit = npt.NDArray[np.uint8]
Volume = npt.NDArray[np.float64]


class Run(NamedTuple):
    """Pixels of one row that are processed together, so that their costs stay in the processor's cache."""

    y: int
    first: int
    end: int
    """Columns `first` to `end`; the runs of a row follow one another."""
    is_top: bool
    """Whether this is the first row of its band."""
    lags: int
    origin: int
    """Column of the right features, without a border, that column 0 of the left image meets at the first lag."""


class CostTerm(NamedTuple):
    """One term of the matching cost.

    Attributes
    ----------
    weight
        The field of :class:`stereolag.stereo.semi_global.costs.MatchingCost` with its highest cost.
    kind
        The type of its features, by which compiled code identifies the term.
    features
        Computes the features of one image: a named tuple of numbers and arrays, (H, W) or (H, W) with a border of the
        window's radius; called with the image, the radius and the settings.
    add
        Compiled; called with the features of both images, a run, an int32 buffer kept from one row of a band to the
        next, and the float32 costs of the run, (pixels × lags), to which it adds its own.
    reference
        The plain formula: (H, W, W) cost of each pixel of the left image with each pixel in the same row of the right
        image; called with both images, the radius and the settings.
    """

    weight: str
    kind: type[Any]
    features: Callable[[EightBit, int, MatchingCost], Any]
    add: Callable[..., None]
    reference: Callable[[EightBit, EightBit, int, MatchingCost], Volume]
