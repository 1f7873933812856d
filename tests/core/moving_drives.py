"""A small drive of known motion: along a street with a wall at its end, behind a moving car."""

import cv2
import numpy as np
from pairs import texture

from stereolag import Calibration
from stereolag.core.arrays import Array, DoubleMap, EightBit, Mask
from stereolag.io.images import image_png
from stereolag.sequences import StereoFrame
from tests.archives import zipped

ROWS, COLS, FINER = 160, 256, 2
CAMERA = Calibration(focal_px=260.0, baseline_m=0.5)
RATE = 10.0
OWN_KMH, CAR_KMH = 36.0, 72.0
CAR = (-1.2, 1.4, 9.0)
"""Left, right and distance in the first frame, m; it extends from the ground to 0.1 m above the camera."""
GROUND, WALL = 1.5, 32.0
TEXTURES = {
    name: texture(512, 512, seed=seed, blur=2.0).astype(np.float32)
    for seed, name in enumerate(("wall", "ground", "car"))
}


def frame(number: int) -> StereoFrame:
    """Return the views of both cameras `number` tenths of a second after the start."""
    return StereoFrame(*(_seen(number, side * CAMERA.baseline_m) for side in (0, 1)))


def car_mask(number: int) -> Mask:
    """Return (rows, cols), True where the left camera sees the car."""
    return np.asarray(_surfaces(number, 0.0, 1)[0] == 2)


def archive(count: int, *, every: int = 1) -> bytes:
    """Return a ZIP with left/ and right/, of the drive's every n-th frame; 0 repeats the first."""
    views = [frame(every * number) for number in range(count)]
    sides = ("left", "right")
    return zipped({f"{side}/{n:03d}.png": image_png(getattr(views[n], side)) for n in range(count) for side in sides})


def _surfaces(number: int, aside: float, finer: int) -> tuple[Array, DoubleMap]:
    """Return the surface of each pixel, 0 wall, 1 ground, 2 car, and the point on it, (rows, cols, 3) metres."""
    time = number / RATE
    own, car = OWN_KMH / 3.6 * time, CAR[2] + CAR_KMH / 3.6 * time
    row, col = np.mgrid[: ROWS * finer, : COLS * finer] / finer
    x, y = (col - (COLS - 1) / 2) / CAMERA.focal_px, (row - (ROWS - 1) / 2) / CAMERA.focal_px
    depth, kind = np.full(x.shape, WALL - own), np.zeros(x.shape, np.int64)
    down = np.where(y > 0, GROUND / np.maximum(y, 1e-9), np.inf)
    depth, kind = np.minimum(depth, down), np.where(down < depth, 1, kind)
    away = car - own
    across, height = aside + x * away, y * away
    on_car = (across > CAR[0]) & (across < CAR[1]) & (height > -0.1) & (height < GROUND) & (away < depth + 1e-6)
    depth, kind = np.where(on_car, away, depth), np.where(on_car, 2, kind)
    place = np.stack([aside + x * depth, y * depth, depth + own], axis=-1)
    place[on_car, 2] = 0
    return kind, place


def _seen(number: int, aside: float) -> EightBit:
    kind, place = _surfaces(number, aside, FINER)
    shown = np.zeros(kind.shape, np.float32)
    for index, (name, axes, per_metre) in enumerate(
        (("wall", (0, 1), 14), ("ground", (0, 2), 24), ("car", (0, 1), 40))
    ):
        at = [np.mod(place[..., axis] * per_metre, 511).astype(np.float32) for axis in axes]
        shown = np.where(kind == index, cv2.remap(TEXTURES[name], at[0], at[1], cv2.INTER_LINEAR), shown)
    small = cv2.resize(shown, (COLS, ROWS), interpolation=cv2.INTER_AREA)
    return np.clip(np.rint(small), 0, 255).astype(np.uint8)
