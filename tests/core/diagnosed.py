"""Diagnoses of the input doctor, cached because several tests look at the same one."""

from __future__ import annotations

import numpy as np

from stereolag.assess.diagnosis import Diagnosis, diagnose

_MADE: dict[tuple[object, ...], Diagnosis] = {}


def diagnosed(left: np.ndarray, right: np.ndarray, *, min_disparity: int = 0, num_disparities: int = 64) -> Diagnosis:
    """Return the result of :func:`diagnose` for a pair, cached."""
    pair = ((image.dtype.str, image.shape, image.tobytes()) for image in (left, right))
    key = (*pair, min_disparity, num_disparities)
    if key not in _MADE:
        _MADE[key] = diagnose(left, right, min_disparity=min_disparity, num_disparities=num_disparities)
    return _MADE[key]
