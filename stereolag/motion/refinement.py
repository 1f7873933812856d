"""Variational refinement of the flow, by OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.settings import Settings
from stereolag.motion.pyramid import Flow


class VariationalRefinement(Settings):
    """Adjusts the flow so that grey levels and gradients of both frames agree best while it stays smooth.

    OpenCV's ``VariationalRefinement``, after T. Brox, A. Bruhn, N. Papenberg & J. Weickert, "High accuracy optical flow
    estimation based on a theory for warping", ECCV 2004.
    """

    smoothness: float = Field(
        default=20.0,
        title="Smoothness",
        description="Weight of smoothness against agreement (OpenCV's alpha).",
        gt=0,
        le=1000,
        json_schema_extra={"step": 5},
    )
    iterations: int = Field(
        default=3, title="Iterations", description="Of the outer loop (OpenCV's fixedPointIterations).", ge=1, le=100
    )


def refined(
    flow: Flow, first: npt.NDArray[np.uint8], second: npt.NDArray[np.uint8], settings: VariationalRefinement
) -> Flow:
    """Return the refined flow.

    Parameters
    ----------
    flow
        (2, H, W) px, finite.
    first, second
        (H, W) uint8 frames.
    settings
        The settings of the refinement.
    """
    refinement = cv2.VariationalRefinement.create()
    refinement.setAlpha(settings.smoothness)
    refinement.setFixedPointIterations(settings.iterations)
    dx, dy = refinement.calcUV(first, second, flow[1].copy(), flow[0].copy())
    return np.stack([dy, dx])
