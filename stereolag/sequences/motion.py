"""Motion in a sequence: the flow since the previous frame, our own speed, and moving things."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from stereolag.core.arrays import FloatMap, Rgb
from stereolag.core.inputs import Image
from stereolag.core.jobs import Progress
from stereolag.core.settings import Settings
from stereolag.figures.pictures import (
    NO_ANSWER,
    as_rgb,
    flow_colours,
    largest_motion,
    outline_of,
    with_arrows,
    with_outlines,
)
from stereolag.geometry.calibration import Calibration
from stereolag.motion.flow import optical_flow
from stereolag.motion.scene_flow import SceneFlow, scene_flow
from stereolag.sequences.records import MOTION, FrameRecord
from stereolag.sequences.sources import StereoFrame, StereoSequence
from stereolag.sequences.steadying import Steadiness
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.stereo.methods import preset


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


SAMPLED = 5
"""Frames, spread over the sequence, that determine the displacement at the rim of the colour wheel."""

ARROW_EVERY = 1 / 28
"""Spacing of the arrows, as a share of the width."""

DIMMED = 0.45
"""Brightness of the picture under the arrows."""


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """The motion between a frame and the previous one.

    Attributes
    ----------
    dy, dx
        (H, W) float32 displacement of every pixel since the previous frame, px; NaN = unknown.
    coverage
        Share of the pixels that have a flow, 0..1.
    scene
        The motion in metres; None without a calibration, or if no static scene was found.
    milliseconds
        Time for all of it.
    """

    dy: FloatMap
    dx: FloatMap
    coverage: float
    scene: SceneFlow | None
    milliseconds: float

    def things(self) -> str:
        """Return the text for the table that lists the moving things, nearest first."""
        regions = () if self.scene is None else self.scene.regions
        return "; ".join(
            f"{one.distance_m:.1f} m" + (f" {one.speed_kmh:.0f} km/h" if one.trusted else "") for one in regions
        )


class MotionWatch:
    """Detector of the motion in each frame of a sequence since the previous one.

    It looks back in time: from a car driving forwards, points seen now were in the previous picture, not vice versa.

    Parameters
    ----------
    sequence
        The sequence.
    method
        Its search range is used with a calibration, for disparities by the fast preset.
    calibration
        Calibration of the left camera; without it only the flow is computed.
    settings
        Settings of the drawing and the speeds.
    largest
        Displacement at the rim of the colour wheel, px, if known from an earlier job.

    Attributes
    ----------
    largest
        The same; None until known.
    """

    def __init__(
        self,
        sequence: StereoSequence,
        method: StereoMatcher,
        calibration: Calibration | None,
        settings: SequenceMotion | None = None,
        largest: float | None = None,
    ) -> None:
        reach, fast = method.reach(), preset("fast")
        self._matcher = fast if reach is None else fast.with_search_range(*reach)
        self._sequence, self._calibration = sequence, calibration
        self.settings = settings or SequenceMotion()
        self.largest = largest
        self._last: tuple[int, StereoFrame, DisparityMap | None] | None = None

    def since_before(self, number: int, progress: Progress | None = None) -> FrameMotion | None:
        """Return the motion since the previous frame; None for the first frame, or if either frame is damaged."""
        if number == 0:
            return None
        start = time.perf_counter()
        try:
            before, disparity_before = self._matched(number - 1, progress)
            now, disparity = self._matched(number, progress)
            self._last = number, now, disparity
            flow = optical_flow(now.left, before.left, progress=progress)
        except (ValueError, OSError):
            return None
        scene = None
        if self._calibration is not None and disparity is not None and disparity_before is not None:
            try:
                scene = scene_flow(
                    disparity,
                    disparity_before,
                    flow,
                    self._calibration,
                    frames=(now.left, before.left),
                    frame_rate=self.settings.frame_rate or self._sequence.frame_rate,
                )
            except ValueError:  # no static scene in view
                scene = None
        return FrameMotion(-flow.dy, -flow.dx, flow.coverage, scene, 1e3 * (time.perf_counter() - start))

    def lock_colours(self, progress: Progress | None = None) -> None:
        """Set the displacement at the rim of the colour wheel, once, from frames spread over the sequence."""
        if self.largest is not None:
            return
        numbers = np.unique(np.linspace(1, max(1, len(self._sequence) - 1), SAMPLED).round().astype(int))
        flows = []
        for number in numbers[numbers < len(self._sequence)]:
            try:
                now, before = (self._sequence.frame(int(one)).left for one in (number, number - 1))
                flow = optical_flow(now, before, progress=progress)
            except (ValueError, OSError):
                continue
            flows.append((flow.dy, flow.dx))
        self.largest = largest_motion(*flows) if flows else 1.0

    def drawn(self, left: Image, motion: FrameMotion | None) -> tuple[Rgb, Rgb]:
        """Return the left picture with moving things outlined, and the picture of the flow."""
        picture = as_rgb(left)
        if motion is None or motion.dx.shape != picture.shape[:2]:
            return picture, np.full_like(picture, NO_ANSWER)
        if self.settings.arrows:
            spacing = max(8, round(picture.shape[1] * ARROW_EVERY))
            dim = (picture * np.float32(DIMMED)).astype(np.uint8)
            seen = with_arrows(dim, motion.dy, motion.dx, spacing=spacing)
        else:
            colours = flow_colours(motion.dy, motion.dx, self.largest or 1.0)
            seen = np.where(colours[..., 3:] > 0, colours[..., :3], np.uint8(NO_ANSWER[0]))
        if motion.scene is None:
            return picture, seen
        outlines = [
            outline_of(motion.scene.labels == number, f"{one.speed_kmh:.0f} km/h" if one.trusted else "")
            for number, one in enumerate(motion.scene.regions, start=1)
        ]
        return with_outlines(picture, outlines), seen

    def record(self, number: int, motion: FrameMotion) -> FrameRecord:
        """Return the row of the table."""
        speed = None if motion.scene is None else motion.scene.own_speed_kmh
        return FrameRecord(
            number,
            self._sequence.names[number],
            number / self._sequence.frame_rate,
            MOTION,
            coverage=motion.coverage,
            milliseconds=motion.milliseconds,
            own_speed_kmh=math.nan if speed is None else speed,
            moving=motion.things(),
        )

    def _matched(self, number: int, progress: Progress | None) -> tuple[StereoFrame, DisparityMap | None]:
        if self._last is not None and self._last[0] == number:
            return self._last[1], self._last[2]
        frame = self._sequence.frame(number)
        if self._calibration is None:
            return frame, None
        return frame, self._matcher.compute(frame.left, frame.right, progress=progress)
