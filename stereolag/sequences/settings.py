"""What is done with a sequence beyond matching each frame by itself."""

from __future__ import annotations

from pydantic import Field

from stereolag.sequences.steadying import Steadiness
from stereolag.settings import Settings


class SequenceMotion(Settings):
    """What is told and drawn of the motion from frame to frame."""

    arrows: bool = Field(
        default=False, title="Arrows", description="Draw the flow as arrows on the picture, not as colours."
    )
    frame_rate: float | None = Field(
        default=None,
        title="Frames a second",
        description="Of the camera, for speeds; None: that of the sequence.",
        gt=0,
        le=10_000,
    )


class SequenceSettings(Settings):
    """What is done to the maps of a sequence beyond matching each frame by itself."""

    steadiness: Steadiness | None = Field(
        default=None,
        title="Steady",
        description="Average each map with that of the frame before, carried over along the motion of the picture, "
        "where the two agree. Our own methods flicker less by it, OpenCV's hardly.",
    )
    motion: SequenceMotion | None = Field(
        default=None,
        title="Motion",
        description="Tell our own speed and what moves against the world, which needs a calibration, and show the "
        "optical flow since the frame before. It takes about a second a frame.",
    )
