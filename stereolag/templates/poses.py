"""Search for a template that may be resized and rotated in the image, from coarse to fine.

Every size and angle of a grid is searched at every place of a reduced grey image; the best places are then refined in
colour, in smaller and smaller steps of size and angle, on larger and larger images.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import product

import numpy as np

from stereolag.core.inputs import Image
from stereolag.core.jobs import Progress, silent
from stereolag.loops.bands import in_threads
from stereolag.templates.patterns import Pattern, in_grey, reduced, warped, warped_shape
from stereolag.templates.places import Places, peaks, positions_near
from stereolag.templates.redrawn import redrawn_place
from stereolag.templates.score_maps import best_position, fft_score_map

Range = tuple[float, float]

SCALE_STEP = 1.15
"""Ratio of neighbouring sizes of the coarse grid: half a step moves the rim of a square reduced template by up to
1.3 px, as does half a :data:`ROTATION_STEP`."""

ROTATION_STEP = 15.0
"""Step of the coarse grid for a square template, degrees."""

COARSE_SIDE_PX = 14
"""Side of the smallest template, the root of its area, in the reduced image."""


@dataclass(frozen=True)
class PoseRange:
    """A range of sizes and angles.

    Parameters
    ----------
    scales, rotations
        Smallest and largest, as for :func:`~stereolag.templates.match_template`.
    """

    scales: Range
    rotations: Range

    def grid(self, shape: tuple[int, ...]) -> list[tuple[float, float]]:
        """Return the scales and rotations of the coarse search for a template of that shape, both ends included.

        A full circle has only one end, as both are the same angle.
        """
        sizes = math.ceil(math.log(self.scales[1] / self.scales[0]) / math.log(SCALE_STEP) - 1e-9) + 1
        angles = math.ceil((self.rotations[1] - self.rotations[0]) / rotation_step(shape) - 1e-9) + 1
        return [
            (float(scale), float(rotation))
            for scale in np.geomspace(*self.scales, sizes)
            for rotation in np.linspace(*self.rotations, angles)[: angles - self._is_circle]
        ]

    def within(self, scale: float, rotation: float) -> tuple[float, float]:
        """Return the nearest scale and rotation within the ranges; in a full circle the rotation wraps around."""
        (smallest, largest), (first, last) = self.scales, self.rotations
        turned = (rotation - first) % 360 + first if self._is_circle else min(max(rotation, first), last)
        return min(max(scale, smallest), largest), turned

    @property
    def _is_circle(self) -> bool:
        return self.rotations[1] - self.rotations[0] >= 360

    def coarse_factor(self, shape: tuple[int, ...]) -> float:
        """Return the factor by which the image is reduced in the coarse search for a template of that shape."""
        sides = shape[:2]
        return max(1.0, self.scales[0] * min(math.sqrt(sides[0] * sides[1]) / COARSE_SIDE_PX, min(sides) / 5))


def rotation_step(shape: tuple[int, ...]) -> float:
    """Return the step of the coarse search, degrees: a rotation moves the ends of a longer template further."""
    return ROTATION_STEP * math.sqrt(shape[0] * shape[1]) / max(shape[:2])


def checked_poses(method: str, scales: Range | None, rotations: Range | None) -> PoseRange | None:
    """Return the sizes and angles to search; None for the template's own alone.

    Raises
    ------
    ValueError
        Not two numbers in order, out of bounds, or a method other than "fft".
    """
    if scales is None and rotations is None:
        return None
    if method != "fft":
        raise ValueError(f"method is {method!r}; sizes and angles are searched by 'fft' alone.")
    return PoseRange(
        _checked_range(scales, "scales", (0.1, 10.0), 1.0),
        _checked_range(rotations, "rotations", (-180.0, 180.0), 0.0),
    )


def _checked_range(given: Range | None, name: str, allowed: Range, default: float) -> Range:
    if given is None:
        return default, default
    if np.shape(given) != (2,):
        raise ValueError(f"{name} is {given!r}; allowed are a smallest and a largest number.")
    low, high = (float(end) for end in given)
    if not allowed[0] <= low <= high <= allowed[1]:
        raise ValueError(
            f"{name} is ({low:g}, {high:g}); allowed are a smallest and a largest number from {allowed[0]:g} to "
            f"{allowed[1]:g}."
        )
    return low, high


FINE_SIDE_PX = 160
"""Side above which a template is refined in a reduced image as well."""

PLACES_PER_POSE = 30
"""Largest number of places kept per size and angle."""

REFINED_AT_ONCE = 40
"""Number of places refined at a time; more follow while copies are among them."""

MIN_FINISHED = 10
"""Number of places refined to the end whatever their scores; copies follow."""

MIN_COPY_SCORE = 0.7
"""Least score of a copy once refined."""

MAX_BELOW_BEST = 0.25
"""Largest difference of a copy's score from the best."""

MAX_OVERLAP = 0.5
"""Largest overlap of two places once refined, as a share of the smaller box."""

MAX_COARSE_OVERLAP = 0.7
"""The same before: a place at a wrong angle can lie across two others."""

HALVINGS = 4
"""Number of times that the steps are halved to refine a place to the end."""

POSITIONS_PER_REFINEMENT = 9 * 25
"""Approximate number of positions scored to refine a pose once."""

MAX_CACHED_VALUES = 500_000
"""Pixel values of warped templates kept: many places are refined at the same size and angle."""

COARSE_TIME_SHARE = 0.6
"""Rough share of the time that the coarse search takes."""


@dataclass(frozen=True)
class Pose:
    """Position, size and angle of a template.

    Parameters
    ----------
    row, col
        Centre in the full image, px from the top-left corner of the top-left pixel.
    scale, rotation
        As in :class:`~stereolag.templates.TemplateMatch`.
    score
        Correlation there.
    """

    row: float
    col: float
    scale: float
    rotation: float
    score: float


def posed_places(image: Image, pattern: Pattern, poses: PoseRange, progress: Progress) -> tuple[Places, int]:
    """Return the best places of a template at any size and angle in the ranges, and the number of positions scored.

    Parameters
    ----------
    image
        (rows, cols, channels), of which those of the pattern come first.
    pattern
        The template.
    poses
        The sizes and angles.
    progress
        Called with the fraction done.
    """
    image = np.ascontiguousarray(image[:, :, : len(pattern.deviations)])
    factor = poses.coarse_factor(pattern.shape)
    coarse, candidates = _coarse_search(image, pattern, factor, poses, progress)
    finest = max(1.0, math.sqrt(pattern.shape[0] * pattern.shape[1]) / FINE_SIDE_PX)
    between = max(finest, factor / 2)
    steps = 0.5 * math.log(SCALE_STEP), 0.5 * rotation_step(pattern.shape)
    fine = _Level(image, finest, pattern, poses)
    first = _Level(image, between, pattern, poses) if between > 1 else fine
    share = (1 - COARSE_TIME_SHARE) / 2
    refined: list[Pose] = []
    for start in range(0, len(coarse), REFINED_AT_ONCE):
        jobs = [partial(first.refined, pose, *steps, 2) for pose in coarse[start : start + REFINED_AT_ONCE]]
        span = COARSE_TIME_SHARE + share * start / len(coarse), share * len(jobs) / len(coarse)
        batch = in_threads(jobs, lambda done, span=span: progress(span[0] + span[1] * done))  # type: ignore[misc]
        refined += batch
        least = max(MIN_COPY_SCORE, max(pose.score for pose in refined) - MAX_BELOW_BEST)
        if max(pose.score for pose in batch) < least:
            break
    best = _apart(refined, image.shape, pattern, MAX_OVERLAP)
    least = max(MIN_COPY_SCORE, max((pose.score for pose in best), default=0.0) - MAX_BELOW_BEST)
    kept = [pose for number, pose in enumerate(best) if number < MIN_FINISHED or pose.score >= least]
    places = in_threads(
        [partial(fine.finished, pose, *steps) for pose in kept], lambda done: progress(1 - share * (1 - done))
    )
    if poses.rotations == (0.0, 0.0) and not pattern.silhouette and (pattern.weights == 1).all():
        places += _redrawn([pose for pose in best if pose.score < MIN_COPY_SCORE], image, pattern, poses)
    scored = (len(refined) + HALVINGS * len(kept)) * POSITIONS_PER_REFINEMENT
    return _as_places(_apart(places, image.shape, pattern, MAX_OVERLAP), image.shape, pattern), candidates + scored


def _redrawn(given: list[Pose], image: Image, pattern: Pattern, poses: PoseRange) -> list[Pose]:
    """Return the given poses where the template may be drawn anew, with its size there."""
    corners = _as_places(given, image.shape, pattern)
    jobs = [
        partial(redrawn_place, image, pattern, *corners.corner(number), pose.scale) for number, pose in enumerate(given)
    ]
    return [
        Pose(row, col, poses.within(size, 0.0)[0], 0.0, score)
        for row, col, size, score in filter(None, in_threads(jobs, silent))
    ]


def _coarse_search(
    image: Image, pattern: Pattern, factor: float, poses: PoseRange, progress: Progress
) -> tuple[list[Pose], int]:
    """Return the best places over all sizes and angles, best first, and the number of positions scored."""
    grey_image, grey = in_grey(image, pattern)
    coarse = reduced(grey_image, factor)
    down, across = image.shape[0] / coarse.shape[0], image.shape[1] / coarse.shape[1]

    def search(scale: float, rotation: float) -> tuple[list[Pose], int]:
        small = warped(grey, scale / factor, rotation)
        if small is None or not small.fits(coarse):
            return [], 0
        score_map = fft_score_map(coarse, small, silent)
        found = peaks(score_map, small.shape)
        places = [
            Pose(
                (found.rows[index] + small.shape[0] / 2) * down,
                (found.cols[index] + small.shape[1] / 2) * across,
                scale,
                rotation,
                float(found.scores[index]),
            )
            for index in found.best(PLACES_PER_POSE, share=MAX_COARSE_OVERLAP)
        ]
        return places, score_map.size

    found = in_threads(
        [partial(search, *pose) for pose in poses.grid(pattern.shape)], lambda done: progress(COARSE_TIME_SHARE * done)
    )
    candidates = [pose for poses, _ in found for pose in poses]
    return _apart(candidates, image.shape, pattern, MAX_COARSE_OVERLAP), sum(size for _, size in found)


class _Level:
    """The image reduced by a factor, in which poses are refined."""

    def __init__(self, image: Image, factor: float, pattern: Pattern, poses: PoseRange) -> None:
        self._image = reduced(image, factor) if factor > 1 else image
        self._warped = lru_cache(max(1, MAX_CACHED_VALUES // pattern.colours.size))(partial(warped, pattern))
        self._poses = poses
        self._down, self._across = (
            before / after for before, after in zip(image.shape[:2], self._image.shape[:2], strict=True)
        )

    def refined(self, pose: Pose, log_scale: float, rotation: float, reach: int) -> Pose:
        """Return the best of the poses at most one step of size and angle away, within `reach` px."""
        poses = (
            self._poses.within(pose.scale * math.exp(down * log_scale), pose.rotation + across * rotation)
            for down, across in product((-1, 0, 1), repeat=2)
        )
        # Beyond the ends of a range, several are the same.
        refined = (self._best_near(pose, *neighbour, reach) for neighbour in dict.fromkeys(poses))
        return max(refined, key=lambda neighbour: neighbour.score)

    def finished(self, pose: Pose, log_scale: float, rotation: float) -> Pose:
        """Return a pose refined in smaller and smaller steps."""
        for halved in range(1, HALVINGS + 1):
            pose = self.refined(pose, log_scale / 2**halved, rotation / 2**halved, 2 if halved == 1 else 1)
        # The steps of the grid would never hit the template's own size and angle, the likeliest of all.
        upright = self._best_near(pose, *self._poses.within(1.0, 0.0), 1)
        return max(pose, upright, key=lambda candidate: candidate.score)

    def _best_near(self, pose: Pose, scale: float, rotation: float, reach: int) -> Pose:
        """Return the best place near a pose for a size and angle; its score is -1 where the template does not fit."""
        pattern = self._warped(scale / math.sqrt(self._down * self._across), rotation)
        best = None
        if pattern is not None:
            height, width = pattern.shape
            top, left = round(pose.row / self._down - height / 2), round(pose.col / self._across - width / 2)
            best = best_position(self._image, pattern, *positions_near(self._image, pattern, top, left, reach))
        if pattern is None or best is None:
            return replace(pose, scale=scale, rotation=rotation, score=-1.0)
        row, col, score = best
        return Pose((row + height / 2) * self._down, (col + width / 2) * self._across, scale, rotation, score)


def _apart(poses: list[Pose], full: tuple[int, ...], pattern: Pattern, share: float) -> list[Pose]:
    """Return the poses whose boxes lie in the image, best first, without those that overlap a better one by more."""
    places = _as_places(poses, full, pattern)
    return [poses[index] for index in places.best(len(poses), share=share, among=np.flatnonzero(places.scores > -1))]


def _as_places(poses: list[Pose], full: tuple[int, ...], pattern: Pattern) -> Places:
    """Return poses as positions of the upright boxes around them; the score is -1 if a box does not fit the image."""
    boxes = np.array([warped_shape(pattern.shape, pose.scale, pose.rotation) for pose in poses]).reshape(-1, 2)
    centres = np.array([(pose.row, pose.col) for pose in poses]).reshape(-1, 2)
    room = np.array(full[:2]) - boxes
    corners = np.clip(np.rint(centres - boxes / 2).astype(np.intp), 0, np.maximum(room, 0))
    scores = np.where((room >= 0).all(axis=1), [pose.score for pose in poses], -1.0)
    return Places(corners[:, 0], corners[:, 1], scores, pattern.shape, [(pose.scale, pose.rotation) for pose in poses])
