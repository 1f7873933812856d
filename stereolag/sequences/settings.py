"""Settings for a sequence beyond matching each frame by itself."""

from __future__ import annotations

from pydantic import Field

from stereolag.core.settings import Settings
from stereolag.sequences.steadying import Steadiness


class SequenceMotion(Settings):
    """Settings for reporting and drawing the motion between frames."""

    arrows: bool = Field(
        default=False, title="Arrows", description="Draw the flow as arrows on the picture, not as colours."
    )
    frame_rate: float | None = Field(
        default=None,
        title="Frames a second",
        description="Frame rate of the camera, for speeds; None: the sequence's own.",
        gt=0,
        le=10_000,
    )


class SequenceSettings(Settings):
    """Settings for the maps of a sequence beyond matching each frame by itself."""

    steadiness: Steadiness | None = Field(
        default=None,
        title="Steady",
        description="Average each map with that of the previous frame, moved along with the picture, where the two "
        "agree. It reduces the flicker of our own methods, but hardly that of OpenCV's.",
    )
    motion: SequenceMotion | None = Field(
        default=None,
        title="Motion",
        description="Show the optical flow since the previous frame and, with a calibration, the car's own speed and "
        "moving objects. It takes about a second a frame.",
    )
