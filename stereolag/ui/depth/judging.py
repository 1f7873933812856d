"""A map held against the truth of its pair, worked out once for all parts of the page."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.stereo.evaluation import Evaluation, evaluate
from stereolag.stereo.result import DisparityMap
from stereolag.ui.pairs import StereoPair
from stereolag.ui.results import remembered


def judged(pair: StereoPair, result: DisparityMap, truth: npt.NDArray[np.float32]) -> Evaluation:
    """Return the figures of a map over all pixels with truth; from memory where they were worked out before."""
    return remembered(
        lambda: evaluate(result.disparity, truth),
        inputs=pair.digest,
        settings=settings_of(result),
        shared=pair.shared,
        name="evaluation",
    )


def settings_of(result: DisparityMap) -> str:
    """Return what tells the maps of one pair apart: which matcher made it, and with which settings."""
    return f"{type(result.settings).__name__} {result.settings.model_dump_json()}"
