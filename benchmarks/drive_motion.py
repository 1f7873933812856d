"""Accuracy of flow, own speed, outlines and car speeds on the example drive, whose motion is known exactly."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag import optical_flow, preset, read_calibration, read_image
from stereolag.geometry.calibration import Calibration
from stereolag.io.disparities import read_stored_disparity
from stereolag.motion.moving_objects import KMH
from stereolag.motion.scene_flow import scene_flow
from stereolag.samples import DriveExample

FRAME_STEP = 8
"""Step between the frames that are evaluated."""

MIN_PIXELS = 800
"""Size below which objects are neither required nor counted as wrong, px."""

MAX_DISTANCE_M = 45.0
"""Distance beyond which objects are neither required nor counted as wrong, metres."""

Flow = npt.NDArray[np.float32]
Masks = npt.NDArray[np.uint8]


@dataclass
class Judged:
    """Figures over all frames: end-point errors by method, and the results for the cars."""

    flow: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    own_kmh: list[float] = field(default_factory=list)
    overlaps: list[float] = field(default_factory=list)
    asked: int = 0
    speeds: list[float] = field(default_factory=list)
    untold: int = 0
    wrong: int = 0


@dataclass(frozen=True)
class RigidMotion:
    """Motion of every pixel from one frame to the next, all ``(height, width)`` float32, px.

    Attributes
    ----------
    dy, dx
        Position of the pixel's point in the next frame minus its position in this one; NaN where the point will be
        behind the camera. It may be outside the next frame, or hidden there.
    disparity_change
        Disparity of the point in the next frame minus its disparity in this one.
    """

    dy: npt.NDArray[np.float32]
    dx: npt.NDArray[np.float32]
    disparity_change: npt.NDArray[np.float32]


def rigid_motion(
    disparity: npt.NDArray[np.floating], objects: Masks, motions: npt.NDArray[np.floating], calibration: Calibration
) -> RigidMotion:
    """Return the optical flow and the change of disparity caused by rigid motions.

    Entry `n` of the (bodies, 4, 4) motions takes the body that `objects` numbers so from the left camera's coordinates
    in this frame (metres) to those in the next. A disparity of 0 or NaN means infinitely far: a point is represented
    as ``(x, y, z, 1) / z``, whose last component is then 0, which leaves only the rotation (Menze & Geiger, "Object
    Scene Flow for Autonomous Vehicles", 2015).
    """
    shift = np.where(disparity > 0, disparity + calibration.doffs_px, 0.0)
    focal, scale = calibration.focal_px, calibration.focal_px * calibration.baseline_m
    height, width = shift.shape
    cx, cy = calibration.centre(width, height)
    rows, columns = np.mgrid[:height, :width].astype(np.float64)
    point = np.stack([(columns - cx) / focal, (rows - cy) / focal, np.ones(shift.shape), shift / scale], -1)
    moved = np.einsum("hwij,hwj->hwi", motions[objects], point)
    ahead = np.where(moved[..., 2] > 0, moved[..., 2], np.nan)
    return RigidMotion(
        dy=(focal * moved[..., 1] / ahead + cy - rows).astype(np.float32),
        dx=(focal * moved[..., 0] / ahead + cx - columns).astype(np.float32),
        disparity_change=(shift / ahead - shift).astype(np.float32),
    )


def _truths(drive: DriveExample, number: int) -> tuple[npt.NDArray[np.float32], Masks]:
    found = read_stored_disparity(drive.disparity[number])
    return found.stored.astype(np.float32) / 256, read_image(drive.objects[number])


def judged(drive: DriveExample, methods: Mapping[str, Callable[[Any, Any], Flow]]) -> Judged:
    """Judge every method and our scene flow, each from a frame to the one before it, as the page does."""
    calibration, result = read_calibration(drive.calibration), Judged()
    poses = np.linalg.inv(_cameras(drive))
    matcher = preset("fast", num_disparities=drive.num_disparities)
    for number in range(FRAME_STEP // 2, len(drive), FRAME_STEP):
        disparity, objects = _truths(drive, number)
        motions = np.linalg.inv(drive.motions(number - 1))
        truth = rigid_motion(disparity, objects, motions, calibration)
        true = np.stack([truth.dy, truth.dx])
        # Rays that slip through seams of the model give no disparity; below the horizon that is not sky.
        known = np.isfinite(true).all(axis=0) & (
            (disparity > 0) | (np.arange(len(disparity)) < len(disparity) // 2)[:, None]
        )
        pairs = [[read_image(side[one]) for side in (drive.left, drive.right)] for one in (number, number - 1)]
        lefts = pairs[0][0], pairs[1][0]
        for name, method in methods.items():
            error = np.hypot(*(method(*lefts) - true))[known]
            result.flow.setdefault(name, []).append((float(error.mean()), 100 * float((error > 3).mean())))
        maps = [matcher.compute(*pair) for pair in pairs]
        found = scene_flow(
            maps[0], maps[1], optical_flow(*lefts), calibration, frames=lefts, frame_rate=drive.frame_rate
        )
        own = KMH * drive.frame_rate * float(np.linalg.norm((poses[number] @ np.linalg.inv(poses[number - 1]))[:3, 3]))
        result.own_kmh.append(abs((found.own_speed_kmh or 0) - own))
        _judge_things(result, found, objects, disparity, drive, number, calibration.depth)
    return result


def _judge_things(
    result: Judged,
    found: Any,
    objects: Masks,
    disparity: npt.NDArray[np.float32],
    drive: DriveExample,
    number: int,
    depth: Callable[..., Any],
) -> None:
    best: dict[int, float] = {}
    for label, region in enumerate(found.regions, start=1):
        mask = found.labels == label
        body = int(np.bincount(objects[mask]).argmax())
        if body == 0:
            result.wrong += 1
            continue
        true = objects == body
        best[body] = max(best.get(body, 0.0), float((mask & true).sum() / (mask | true).sum()))
        if region.trusted:
            result.speeds.append(abs(region.speed_kmh - _speed(drive, body, number)))
        else:
            result.untold += 1
    for body in range(1, len(drive.object_names)):
        true = objects == body
        if true.sum() >= MIN_PIXELS and depth(np.median(disparity[true])) <= MAX_DISTANCE_M:
            result.asked += 1
            if body in best:
                result.overlaps.append(best[body])


def _cameras(drive: DriveExample) -> npt.NDArray[np.float64]:
    return np.asarray(drive.read_poses()["camera"], np.float64)


def _speed(drive: DriveExample, body: int, number: int) -> float:
    bodies = np.asarray(drive.read_poses()["objects"], np.float64)
    step = bodies[number, body, :3, 3] - bodies[number - 1, body, :3, 3]
    return float(KMH * drive.frame_rate * np.linalg.norm(step))


def drive_lines(drive: DriveExample, methods: Mapping[str, Callable[[Any, Any], Flow]]) -> tuple[list[str], Any]:
    """Return the lines of the table, and its figures."""
    found = judged(drive, methods)
    means = {
        name: tuple(statistics.fmean(part) for part in zip(*errors, strict=True)) for name, errors in found.flow.items()
    }
    ours = next(iter(means))
    heading = f"{drive.title}, {len(found.own_kmh)} of its frames and those before them, mean end-point error:"
    lines = ["", heading, "", f"| | {' | '.join(means)} |", "|---" * (1 + len(means)) + "|"]
    lines += [f"| px, and % off by more than 3 px | {' | '.join(f'{a:.2f}, {b:.1f} %' for a, b in means.values())} |"]
    lines += [f"| ours / theirs | {' | '.join(f'{means[ours][0] / a:.3f}' for a, _ in means.values())} |"]
    figures = {
        "own speed, mean error, km/h": statistics.fmean(found.own_kmh),
        "own speed, largest error, km/h": max(found.own_kmh),
        f"cars of {MIN_PIXELS} px within {MAX_DISTANCE_M:g} m": found.asked,
        "of them outlined": len(found.overlaps),
        "overlap of outline and car (IoU), mean": statistics.fmean(found.overlaps) if found.overlaps else 0.0,
        "speeds told": len(found.speeds),
        "speed told, mean error, km/h": statistics.fmean(found.speeds) if found.speeds else 0.0,
        "speed told, largest error, km/h": max(found.speeds, default=0.0),
        "things outlined without a speed": found.untold,
        "things outlined that stand": found.wrong,
    }
    lines += ["", "| scene flow on it | measured |", "|---|---|"]
    lines += [f"| {name} | {value:.3g} |" for name, value in figures.items()]
    return lines, {"epe": means, "scene flow": figures}
