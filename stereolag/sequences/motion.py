"""Change from frame to frame: flicker, maps steadied by the previous frame, our own motion and moving objects."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.arrays import FloatMap, Mask, Rgb
from stereolag.core.inputs import Image, as_eight_bit, as_grey, as_image
from stereolag.core.jobs import Progress
from stereolag.core.settings import Settings
from stereolag.figures.pictures import (
    NO_ANSWER,
    as_rgb,
    flow_colours,
    largest_motion,
    with_arrows,
    with_outlines,
)
from stereolag.geometry.calibration import Calibration
from stereolag.motion.flow import FlowMap, optical_flow
from stereolag.motion.own_motion import Doubt
from stereolag.motion.scene_flow import SceneFlow, scene_flow
from stereolag.motion.verdict import FlowVerdict
from stereolag.sequences.sources import StereoFrame, StereoSequence
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.stereo.methods import preset

MAX_STILL_CHANGE = 3
"""Mean change of a neighbourhood up to which it counts as still, grey levels of 255: about camera noise."""

STILL_WINDOW_PX = 7
"""Side of that neighbourhood, px: about that of a small matching window, so that the matcher's input is unchanged."""


def still_pixels(before: npt.ArrayLike, now: npt.ArrayLike) -> Mask:
    """Return the mask of pixels at which a picture did not change.

    Parameters
    ----------
    before, now
        (H, W), (H, W, 3) or (H, W, 4): two frames of one camera, of one size.

    Returns
    -------
    still
        (H, W) bool.
    """
    frames = as_eight_bit(as_grey(as_image(before, "before")), as_grey(as_image(now, "now")))
    change = cv2.blur(cv2.absdiff(*frames), (STILL_WINDOW_PX, STILL_WINDOW_PX))
    return np.asarray(change <= np.uint8(MAX_STILL_CHANGE))  # as floats they take ten times as long


def flicker(before: npt.ArrayLike, now: npt.ArrayLike, still: npt.ArrayLike) -> float:
    """Return the mean absolute change of the disparity where the picture did not change, px.

    Parameters
    ----------
    before, now
        (H, W) disparities of two consecutive frames, px; NaN = none.
    still
        (H, W) bool from :func:`still_pixels`.

    Returns
    -------
    flicker
        px; NaN if less than a thousandth of the pixels are still and have a disparity in both.

    Raises
    ------
    ValueError
        If the shapes differ.

    Notes
    -----
    The world may move where the picture does not, such as a road passing below the car, but its disparity then stays
    the same: any change comes from the matching. The mean is used because flicker consists of jumps, which a median
    would miss.
    """
    first, second = np.asarray(before, dtype=np.float32), np.asarray(now, dtype=np.float32)
    unchanged = np.asarray(still, dtype=np.bool_)
    if not first.shape == second.shape == unchanged.shape:
        raise ValueError(f"the shapes are {first.shape}, {second.shape} and {unchanged.shape}; all must be one (H, W).")
    change = cv2.absdiff(first, second)[unchanged]
    known = change[np.isfinite(change)]
    return float(known.mean()) if known.size >= 0.001 * first.size and known.size else math.nan


def same_picture_size(before: Image, now: Image) -> bool:
    """Return whether two frames can be compared: a camera may be switched to another size during a sequence."""
    return before.shape[:2] == now.shape[:2] and before.dtype == now.dtype


MIN_SIDE_PX = 16
"""Least width and height of a frame, px: the optical flow needs about that much."""

MAX_SAME_CHANGE = 12
"""Mean change of a neighbourhood along the motion up to which both frames show the same, grey levels of 255."""

SAME_WINDOW_PX = 7
"""Side of that neighbourhood, px."""

DRIFT_WINDOW_PX = 45
"""Side of the window over which the change of disparity is averaged, px."""

DRIFT_LIMITS_PX = (3.0, 1.5)
"""Largest deviation of the averaged pixels from the estimate so far, px, in each round."""

SCENE_WEIGHT = 0.05
"""Weight of the change expected from the whole scene, as a share of the pixels of that window."""

QUIET_WINDOW_PX = 91
"""Side of the neighbourhood of a filled pixel, px."""

MIN_QUIET_SHARE = 0.9
"""Share of the measured pixels in that neighbourhood that must be unchanged."""

QUIET_TOLERANCE = 2.0
"""Change up to which they are unchanged, as a multiple of the agreement limit."""

SCENE_STEP = 5
"""Spacing of the pixels from which the change of the whole scene is estimated, px."""

MIN_SCENE_PIXELS = 200
"""Least number of these pixels."""


class Steadiness(Settings):
    """Averages the map of a frame with that of the previous frame, carried over, where the two agree."""

    limit: float = Field(
        default=1.0,
        title="Agreement",
        description="Largest difference at which the map carried over from the previous frame is averaged with this "
        "one, px.",
        gt=0,
        le=16,
        json_schema_extra={"step": 0.25},
    )


class Motion(NamedTuple):
    """Motion of the picture since the previous frame; each (H, W)."""

    col: FloatMap
    """Position of each pixel in the previous frame, px."""
    row: FloatMap
    same: Mask
    """Whether the picture looks the same there."""
    still: Mask
    """Whether the picture did not change at this pixel."""


def motion_since(before: Image, now: Image) -> Motion | None:
    """Return the motion of the picture, by dense inverse search; None if the frames cannot be compared.

    Parameters
    ----------
    before, now
        (H, W), (H, W, 3) or (H, W, 4): two frames of one camera.
    """
    if not same_picture_size(before, now) or min(now.shape[:2]) < MIN_SIDE_PX:
        return None
    old, new = as_eight_bit(as_grey(before), as_grey(now))
    # Identical bit for bit on any number of threads, as it always uses eight stripes.
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    flow = search.calc(new, old, None)  # type: ignore[call-overload]
    rows, cols = new.shape
    col = flow[:, :, 0] + np.arange(cols, dtype=np.float32)
    row = flow[:, :, 1] + np.arange(rows, dtype=np.float32)[:, None]
    inside = (col >= 0) & (col <= cols - 1) & (row >= 0) & (row <= rows - 1)
    warped = cv2.remap(old, col, row, cv2.INTER_LINEAR)
    change = cv2.blur(cv2.absdiff(warped, new), (SAME_WINDOW_PX, SAME_WINDOW_PX))
    return Motion(col, row, inside & (change <= MAX_SAME_CHANGE), still_pixels(before, now))


def steadied(before: DisparityMap, now: DisparityMap, motion: Motion, settings: Steadiness) -> FloatMap:
    """Return the disparities of a frame, averaged with those of the previous frame where both agree.

    Parameters
    ----------
    before, now
        A matcher's maps of the two frames, each by itself.
    motion
        From :func:`motion_since`.
    settings
        The limit of agreement.

    Returns
    -------
    ndarray
        (H, W) float32, px; NaN where `now` has none.

    Notes
    -----
    Disparities of approaching points grow, so the previous map, warped to this frame, is first corrected by the mean
    change of the measured pixels nearby; averaging removes their individual errors. Pixels filled in both maps are
    averaged even if they differ, provided neither the picture nor the measured pixels around them changed.
    """
    previous = _warped(before.disparity, motion, cv2.INTER_LINEAR)
    previously_measured = _warped(before.measured.astype(np.uint8), motion, cv2.INTER_NEAREST) > 0
    previous += _drift(previous, now.disparity, now.measured & motion.same & previously_measured)
    agreeing = motion.same & (np.abs(previous - now.disparity) <= np.float32(settings.limit))
    out = np.where(agreeing, (previous + now.disparity) / 2, now.disparity)
    filled = motion.still & ~agreeing & now.filled & before.filled
    if filled.any():
        filled &= _quiet(before, now, np.float32(QUIET_TOLERANCE * settings.limit))
        out[filled] = (before.disparity[filled] + now.disparity[filled]) / 2
    return np.asarray(out, np.float32)


def _warped(values: FloatMap | np.ndarray, motion: Motion, interpolation: int) -> np.ndarray:
    """Return values of the previous frame at the pixels of this one."""
    return np.asarray(cv2.remap(values, motion.col, motion.row, interpolation))


def _drift(previous: FloatMap, now: FloatMap, both_measured: Mask) -> FloatMap:
    """Return the smooth growth of the disparities since the previous frame, px, from the pixels measured in both.

    Where these are few, it is the growth expected when approaching a static scene, in which 1/d shrinks by the same
    amount everywhere.
    """
    change = now - previous
    sampled = np.s_[::SCENE_STEP, ::SCENE_STEP]
    approach = _approach(previous[sampled], now[sampled], both_measured[sampled])
    disparity = np.maximum(np.nan_to_num(previous), 0)
    scale = np.maximum(1 - approach * disparity, np.float32(0.25))
    expected = np.asarray(approach * disparity * disparity / scale, np.float32)
    drift, size = expected, (DRIFT_WINDOW_PX, DRIFT_WINDOW_PX)
    for limit in DRIFT_LIMITS_PX:
        averaged = both_measured & (np.abs(change - drift) <= np.float32(limit))
        excess = cv2.blur(np.where(averaged, change - expected, np.float32(0)), size)
        share = cv2.blur(averaged.astype(np.float32), size)
        drift = np.asarray(expected + excess / (share + np.float32(SCENE_WEIGHT)), np.float32)
    return drift


def _approach(previous: FloatMap, now: FloatMap, both_measured: Mask) -> np.float32:
    """Return the decrease of 1/d, per px: a median weighted towards near pixels, which are the most accurate."""
    used = both_measured & (previous > 1) & (now > 1)
    if np.count_nonzero(used) < MIN_SCENE_PIXELS:
        return np.float32(0)
    before, after = previous[used].astype(np.float64), now[used].astype(np.float64)
    weight = before * after
    decrease = (after - before) / weight
    order = np.argsort(decrease, kind="stable")
    total = np.cumsum(weight[order])
    return np.float32(decrease[order][np.searchsorted(total, total[-1] / 2)])


def _quiet(before: DisparityMap, now: DisparityMap, limit: np.float32) -> Mask:
    """Return the mask of pixels around which nearly all measured pixels kept their disparity."""
    both, size = before.measured & now.measured, (QUIET_WINDOW_PX, QUIET_WINDOW_PX)
    kept = both & (np.abs(now.disparity - before.disparity) <= limit)
    kept_share, both_share = (cv2.blur(one.astype(np.float32), size) for one in (kept, both))
    return np.asarray(kept_share >= np.float32(MIN_QUIET_SHARE) * both_share)


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


SAMPLED_FRAMES = 5
"""Frames, spread over the sequence, that determine the colours of disparities and of the flow before one is drawn."""


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """The motion between a frame and the previous one.

    Attributes
    ----------
    flow_back
        The flow back to the previous frame.
    scene
        The motion in metres; None without a calibration, or if no static scene was found.
    problem
        The verdict of the :class:`~stereolag.motion.flow.FlowMap` unless the frames are related; otherwise the doubt
        of the :class:`~stereolag.motion.scene_flow.SceneFlow`.
    milliseconds
        Time for flow and motion.
    """

    flow_back: FlowMap
    scene: SceneFlow | None
    problem: FlowVerdict | Doubt
    milliseconds: float

    def figures(self) -> dict[str, Any]:
        """Return the figures for the table; moving objects are listed nearest first."""
        figures: dict[str, Any] = {
            "coverage": self.flow_back.coverage,
            "milliseconds": self.milliseconds,
            "problem": self.problem,
        }
        if self.scene is None:
            return figures
        if not self.problem:
            figures |= {
                "own_speed_kmh": self.scene.own_speed_kmh,
                "own_speed_error_kmh": self.scene.own_speed_error_kmh,
            }
        objects = (
            f"{one.distance_m:.1f} m"
            + (f" {one.speed_kmh:.0f} ± {one.speed_error_kmh:.0f} km/h" if one.trusted else "")
            for one in self.scene.regions
        )
        return figures | {"moving": "; ".join(objects)}


class MotionDetector:
    """Detector of the motion in each frame of a sequence since the previous one.

    Each frame is matched with the previous one, not with the next: from a car driving forwards, points visible now were
    in the previous picture too.

    Parameters
    ----------
    sequence
        The sequence.
    method
        The method whose search range is used, if there is a calibration; the disparities are those of the fast preset.
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
        search_range, fast = method.reach(), preset("fast")
        self._matcher = fast if search_range is None else fast.with_search_range(*search_range)
        self._sequence, self._calibration = sequence, calibration
        self.settings = settings or SequenceMotion()
        self.largest = largest
        self._last: tuple[int, StereoFrame, DisparityMap | None] | None = None

    def motion_of(self, number: int, progress: Progress | None = None) -> FrameMotion | None:
        """Return the motion since the previous frame; None for the first frame, or if either frame is damaged."""
        if number == 0:
            return None
        start = time.perf_counter()
        try:
            before, disparity_before = self._frame_and_map(number - 1, progress)
            now, disparity = self._frame_and_map(number, progress)
            self._last = number, now, disparity
            flow = optical_flow(now.left, before.left, progress=progress)
        except (ValueError, OSError):
            return None
        scene: SceneFlow | None = None
        problem: FlowVerdict | Doubt = "" if flow.verdict == "related" else flow.verdict
        if not problem and self._calibration is not None and disparity is not None and disparity_before is not None:
            rate = self.settings.frame_rate or self._sequence.frame_rate
            try:
                scene = scene_flow(
                    disparity,
                    disparity_before,
                    flow,
                    self._calibration,
                    frames=(now.left, before.left),
                    frame_rate=rate / self._sequence.intervals_before(number),
                )
                problem = scene.doubt
            except ValueError:
                problem = "nothing static"
        return FrameMotion(flow, scene, problem, 1e3 * (time.perf_counter() - start))

    def lock_colours(self, progress: Progress | None = None) -> None:
        """Set the displacement at the rim of the colour wheel, once, from frames spread over the sequence."""
        if self.largest is not None:
            return
        numbers = np.unique(np.linspace(1, max(1, len(self._sequence) - 1), SAMPLED_FRAMES).round().astype(int))
        flows = []
        for number in numbers[numbers < len(self._sequence)]:
            with suppress(ValueError, OSError):
                now, before = (self._sequence.frame(int(one)).left for one in (number, number - 1))
                flow = optical_flow(now, before, progress=progress)
                flows.append((flow.dy, flow.dx))
        self.largest = largest_motion(*flows) if flows else 1.0

    def pictures(self, left: Image, motion: FrameMotion | None) -> tuple[Rgb, Rgb]:
        """Return the left picture with moving objects outlined, and the picture of the flow."""
        picture = as_rgb(left)
        if motion is None or motion.flow_back.dx.shape != picture.shape[:2]:
            return picture, np.full_like(picture, NO_ANSWER)
        dy, dx = -motion.flow_back.dy, -motion.flow_back.dx
        if self.settings.arrows:
            spacing = max(8, round(picture.shape[1] * (1 / 28)))
            flow_picture = with_arrows((picture * np.float32(0.45)).astype(np.uint8), dy, dx, spacing=spacing)
        else:
            colours = flow_colours(dy, dx, self.largest or 1.0)
            flow_picture = np.where(colours[..., 3:] > 0, colours[..., :3], np.uint8(NO_ANSWER[0]))
        if motion.scene is None:
            return picture, flow_picture
        objects = [
            (motion.scene.labels == number, f"{one.speed_kmh:.0f} km/h" if one.trusted else "")
            for number, one in enumerate(motion.scene.regions, start=1)
        ]
        return with_outlines(picture, objects), flow_picture

    def _frame_and_map(self, number: int, progress: Progress | None) -> tuple[StereoFrame, DisparityMap | None]:
        """Return a frame, and its map if there is a calibration."""
        if self._last is not None and self._last[0] == number:
            return self._last[1], self._last[2]
        frame = self._sequence.frame(number)
        if self._calibration is None:
            return frame, None
        return frame, matched_turned(self._matcher, frame, self._sequence.turn, progress)


def matched_turned(
    matcher: StereoMatcher, frame: StereoFrame, quarters: int, progress: Progress | None = None
) -> DisparityMap:
    """Return the map of a frame whose pictures are turned by quarters for the matching, and its map back."""
    return matcher.compute(*frame.turned(quarters), progress=progress).turned(-quarters)
