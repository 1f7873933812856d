"""Settings shared by both OpenCV matchers, each declared once, with OpenCV's name in its description."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from stereolag.core.settings import Applies, FitsImage, Pixels

BlockSize = Annotated[
    int,
    Pixels(),
    FitsImage(),
    Field(
        title="Block",
        description="Side of the compared block, px; odd (OpenCV's blockSize).",
        ge=1,
        le=51,
        json_schema_extra={"step": 2},
    ),
]
UniquenessRatio = Annotated[
    int,
    Field(
        title="Uniqueness",
        description="Least lead of the best match over the second best, percent (OpenCV's uniquenessRatio).",
        ge=0,
        le=100,
    ),
]
SpeckleWindowSize = Annotated[
    int,
    Pixels(power=2),
    Field(
        title="Speckle size",
        description="Smaller islands are dropped, px²; 0 keeps all (OpenCV's speckleWindowSize).",
        ge=0,
        le=5000,
        json_schema_extra={"step": 10},
    ),
]
SpeckleRange = Annotated[
    int,
    Applies(lambda settings: settings.speckle_window_size > 0, "needs speckle_window_size above 0"),
    Field(
        title="Speckle range",
        description="Largest step within one island (OpenCV's speckleRange: StereoBM counts 1/16 px, StereoSGBM px).",
        ge=0,
        le=256,
    ),
]
LeftRightTolerance = Annotated[
    int,
    Field(
        title="Left-right tolerance",
        description="Largest disagreement between the two directions, px; -1: no check (OpenCV's disp12MaxDiff).",
        ge=-1,
        le=64,
    ),
]
