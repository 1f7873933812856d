"""Search for a template that may be resized and rotated in the image, from coarse to fine.

Every size and angle of a grid is searched at every place of a reduced grey image; the best places are then refined in
colour, in ever smaller steps of size and angle, on ever larger images.
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
from stereolag.templates.redrawn import stretched_like
from stereolag.templates.score_maps import best_position, fft_score_map

Range = tuple[float, float]

SCALE_STEP = 1.15
ROTATION_STEP = 15.0
"""Steps of the coarse grid, a ratio and degrees: half a step moves the rim of a square reduced template by up to
1.3 px."""

COARSE_SIDE = 14
"""Side of the smallest template in the reduced image, the root of its area, px."""

SCALES_ALLOWED = 0.1, 10.0
ROTATIONS_ALLOWED = -180.0, 180.0


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

        Of a full circle one end, as both are the same angle.
        """
        sizes = math.ceil(math.log(self.scales[1] / self.scales[0]) / math.log(SCALE_STEP) - 1e-9) + 1
        angles = math.ceil((self.rotations[1] - self.rotations[0]) / rotation_step(shape) - 1e-9) + 1
        return [
            (float(scale), float(rotation))
            for scale in np.geomspace(*self.scales, sizes)
            for rotation in np.linspace(*self.rotations, angles)[: angles - self._is_circle]
        ]

    def within(self, scale: float, rotation: float) -> tuple[float, float]:
        """Return the nearest scale and rotation within the ranges; around a full circle the rotation goes on."""
        (least, most), (first, last) = self.scales, self.rotations
        turned = (rotation - first) % 360 + first if self._is_circle else min(max(rotation, first), last)
        return min(max(scale, least), most), turned

    @property
    def _is_circle(self) -> bool:
        return self.rotations[1] - self.rotations[0] >= 360

    def coarse_factor(self, shape: tuple[int, ...]) -> float:
        """Return the factor by which the image is reduced in the coarse search for a template of that shape."""
        sides = shape[:2]
        return max(1.0, self.scales[0] * min(math.sqrt(sides[0] * sides[1]) / COARSE_SIDE, min(sides) / 5))


def rotation_step(shape: tuple[int, ...]) -> float:
    """Return the step of the coarse search, degrees: of a longer template an angle moves the ends more."""
    return ROTATION_STEP * math.sqrt(shape[0] * shape[1]) / max(shape[:2])


def checked_poses(method: str, scales: Range | None, rotations: Range | None) -> PoseRange | None:
    """Return the sizes and angles to search, None if only the template's own are.

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
        _checked_range(scales, "scales", SCALES_ALLOWED, 1.0),
        _checked_range(rotations, "rotations", ROTATIONS_ALLOWED, 0.0),
    )


def _checked_range(given: Range | None, name: str, allowed: Range, alone: float) -> Range:
    if given is None:
        return alone, alone
    if np.shape(given) != (2,):
        raise ValueError(f"{name} is {given!r}; allowed are a smallest and a largest number.")
    low, high = (float(end) for end in given)
    if not allowed[0] <= low <= high <= allowed[1]:
        raise ValueError(
            f"{name} is ({low:g}, {high:g}); allowed are a smallest and a largest number from {allowed[0]:g} to "
            f"{allowed[1]:g}."
        )
    return low, high


FINE_SIDE = 160
"""Template side above which refinement is on a reduced image too, px."""

PER_POSE, REFINED, FINAL = 30, 40, 10
"""Places kept per size and angle, refined at a time, and refined to the end whatever they score."""

COPY, BELOW = 0.7, 0.25
"""Least score of a copy once refined, and how far below the best; while there are such, more places are refined."""

SAME, COARSELY_SAME = 0.5, 0.7
"""Share of the smaller of two boxes above which they are one place: once refined, and before, when one whose angle is
wrong can lie across two others."""

FINER = 4
"""Times that the steps are halved to refine a place to the end."""

SCORED_AROUND = 9 * 25
"""About the number of positions scored to refine a pose once."""

VALUES_KEPT = 500_000
"""Pixel values of warped templates kept: many places are refined at the same size and angle."""

COARSE_SHARE = 0.6
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
    coarse, candidates = _coarse(image, pattern, factor, poses, progress)
    finest = max(1.0, math.sqrt(pattern.shape[0] * pattern.shape[1]) / FINE_SIDE)
    between = max(finest, factor / 2)
    steps = 0.5 * math.log(SCALE_STEP), 0.5 * rotation_step(pattern.shape)
    level = _Level(reduced(image, between), image.shape, pattern, poses) if between > 1 else None
    fine = _Level(reduced(image, finest) if finest > 1 else image, image.shape, pattern, poses)
    first = level or fine
    share = (1 - COARSE_SHARE) / 2
    refined: list[Pose] = []
    for start in range(0, len(coarse), REFINED):
        jobs = [partial(first.refined, pose, *steps, 2) for pose in coarse[start : start + REFINED]]
        span = COARSE_SHARE + share * start / len(coarse), share * len(jobs) / len(coarse)
        batch = in_threads(jobs, lambda done, span=span: progress(span[0] + span[1] * done))  # type: ignore[misc]
        refined += batch
        if max(pose.score for pose in batch) < max(COPY, max(pose.score for pose in refined) - BELOW):
            break
    best = _apart(refined, image.shape, pattern)
    least = max(COPY, max((pose.score for pose in best), default=0.0) - BELOW)
    kept = [pose for number, pose in enumerate(best) if number < FINAL or pose.score >= least]
    places = in_threads(
        [partial(fine.finished, pose, *steps) for pose in kept], lambda done: progress(1 - share * (1 - done))
    )
    if poses.rotations == (0.0, 0.0) and not pattern.silhouette and (pattern.weights == 1).all():
        places += _drawn_anew([pose for pose in best if pose.score < COPY], image, pattern, poses)
    scored = (len(refined) + FINER * len(kept)) * SCORED_AROUND
    return _as_places(_apart(places, image.shape, pattern), image.shape, pattern), candidates + scored


def _drawn_anew(given: list[Pose], image: Image, pattern: Pattern, poses: PoseRange) -> list[Pose]:
    """Return those of the poses, too poor for a copy, where the template may be drawn anew, with its size there."""
    corners = _as_places(given, image.shape, pattern)
    jobs = [
        partial(stretched_like, image, pattern, int(corners.rows[number]), int(corners.cols[number]), pose.scale)
        for number, pose in enumerate(given)
    ]
    return [
        Pose(row, col, poses.within(size, 0.0)[0], 0.0, score)
        for row, col, size, score in filter(None, in_threads(jobs, silent))
    ]


def _coarse(
    image: Image, pattern: Pattern, factor: float, poses: PoseRange, progress: Progress
) -> tuple[list[Pose], int]:
    """Return the best places over all sizes and angles, best first, and the number of positions scored."""
    flat, grey = in_grey(image, pattern)
    little = reduced(flat, factor)
    scaled = image.shape[0] / little.shape[0], image.shape[1] / little.shape[1]

    def search(scale: float, rotation: float) -> tuple[list[Pose], int]:
        small = warped(grey, scale / factor, rotation)
        if small is None or small.shape[0] > little.shape[0] or small.shape[1] > little.shape[1]:
            return [], 0
        score_map = fft_score_map(little, small, silent)
        found = peaks(score_map, small.shape)
        places = [
            Pose(
                (found.rows[one] + small.shape[0] / 2) * scaled[0],
                (found.cols[one] + small.shape[1] / 2) * scaled[1],
                scale,
                rotation,
                float(found.scores[one]),
            )
            for one in found.best(PER_POSE, share=COARSELY_SAME)
        ]
        return places, score_map.size

    found = in_threads(
        [partial(search, *pose) for pose in poses.grid(pattern.shape)], lambda done: progress(COARSE_SHARE * done)
    )
    every = [pose for poses, _ in found for pose in poses]
    return _apart(every, image.shape, pattern, COARSELY_SAME), sum(size for _, size in found)


class _Level:
    """The image at one resolution, in which poses are refined."""

    def __init__(self, image: Image, full: tuple[int, ...], pattern: Pattern, poses: PoseRange) -> None:
        self._image = image
        self._warped = lru_cache(max(1, VALUES_KEPT // pattern.colours.size))(partial(warped, pattern))
        self._poses = poses
        self._scaled = full[0] / image.shape[0], full[1] / image.shape[1]

    def refined(self, pose: Pose, log_scale: float, rotation: float, reach: int) -> Pose:
        """Return the best of the poses at most one step of size and angle away, within `reach` px."""
        poses = (
            self._poses.within(pose.scale * math.exp(down * log_scale), pose.rotation + across * rotation)
            for down, across in product((-1, 0, 1), repeat=2)
        )
        # Beyond the ends of a range they are the same.
        return max((self._near(pose, *around, reach) for around in dict.fromkeys(poses)), key=lambda one: one.score)

    def finished(self, pose: Pose, log_scale: float, rotation: float) -> Pose:
        """Return a pose refined in ever smaller steps."""
        for halved in range(1, FINER + 1):
            pose = self.refined(pose, log_scale / 2**halved, rotation / 2**halved, 2 if halved == 1 else 1)
        # The steps of the grid would never hit the template's own size and angle, the likeliest of all.
        upright = self._near(pose, *self._poses.within(1.0, 0.0), 1)
        return max(pose, upright, key=lambda one: one.score)

    def _near(self, pose: Pose, scale: float, rotation: float, reach: int) -> Pose:
        """Return the best place of a size and angle around a pose; its score is -1 where the template does not fit."""
        tall, wide = self._scaled
        pattern = self._warped(scale / math.sqrt(tall * wide), rotation)
        best = None
        if pattern is not None:
            height, width = pattern.shape
            top, left = round(pose.row / tall - height / 2), round(pose.col / wide - width / 2)
            best = best_position(self._image, pattern, *positions_near(self._image, pattern, top, left, reach))
        if pattern is None or best is None:
            return replace(pose, scale=scale, rotation=rotation, score=-1.0)
        row, col, score = best
        return Pose((row + height / 2) * tall, (col + width / 2) * wide, scale, rotation, score)


def _apart(poses: list[Pose], full: tuple[int, ...], pattern: Pattern, share: float = SAME) -> list[Pose]:
    """Return the poses whose box lies in the image, best first, without those that share too much of a better one's."""
    places = _as_places(poses, full, pattern)
    return [poses[one] for one in places.best(len(poses), share=share, left=np.flatnonzero(places.scores > -1))]


def _as_places(poses: list[Pose], full: tuple[int, ...], pattern: Pattern) -> Places:
    """Return poses as positions of the upright boxes around them; the score is -1 where that is not in the image."""
    boxes = np.array([warped_shape(pattern.shape, pose.scale, pose.rotation) for pose in poses]).reshape(-1, 2)
    centres = np.array([(pose.row, pose.col) for pose in poses]).reshape(-1, 2)
    room = np.array(full[:2]) - boxes
    corners = np.clip(np.rint(centres - boxes / 2).astype(np.intp), 0, np.maximum(room, 0))
    scores = np.where((room >= 0).all(axis=1), [pose.score for pose in poses], -1.0)
    return Places(corners[:, 0], corners[:, 1], scores, pattern.shape, [(pose.scale, pose.rotation) for pose in poses])
