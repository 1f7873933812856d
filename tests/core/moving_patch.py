"""A picture in which a sign moves, in changing light: resized, covered, out of the picture, near one like it."""

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from stereolag.core.arrays import EightBit
from tests.core.pairs import texture

COVERED, AWAY, PARTLY = range(60, 90), range(105, 150), range(165, 195)
"""Frames in which something else hides the sign, in which it goes out and comes back, and in which a quarter of it is
hidden."""


class Frame(NamedTuple):
    """A frame, and where the middle of the sign is in it (row, col) and how large it is; which share can be seen."""

    picture: EightBit
    middle: tuple[float, float]
    size: float
    seen: float


def sign(side: int, seed: int, *, sibling: bool = False) -> EightBit:
    """Return a coloured sign with a few marks; its sibling has one of them elsewhere."""
    rng = np.random.default_rng(seed)
    drawn = np.full((128, 128, 3), rng.integers(140, 200, 3), dtype=np.uint8)
    cv2.rectangle(drawn, (3, 3), (124, 124), rng.integers(0, 90, 3).tolist(), 6)
    for number in range(5):
        colour = rng.integers(0, 255, 3).tolist()
        centre = rng.integers(24, 104, 2)
        if sibling and number == 4:
            centre = (centre + 40) % 80 + 24
        cv2.circle(drawn, tuple(map(int, centre)), int(rng.integers(8, 20)), colour, -1, cv2.LINE_AA)
    return np.asarray(cv2.resize(drawn, (side, side), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def on(picture: EightBit, drawn: EightBit, middle: tuple[float, float], size: float, angle: float = 0.0) -> None:
    """Draw something with its middle at a place of the picture, so large and turned by so many degrees."""
    (rows, cols), side = picture.shape[:2], len(drawn)
    matrix = cv2.getRotationMatrix2D(((side - 1) / 2, (side - 1) / 2), angle, size)
    matrix[:, 2] += np.array([middle[1], middle[0]]) - side / 2
    alpha = cv2.warpAffine(np.ones((side, side), np.float32), matrix, (cols, rows))[:, :, np.newaxis]
    moved = cv2.warpAffine(drawn, matrix, (cols, rows), borderMode=cv2.BORDER_REPLICATE)
    picture[:] = np.rint(picture + alpha * (moved.astype(np.float32) - picture)).astype(np.uint8)


def frames(seed: int, *, rows: int = 240, cols: int = 320, side: int = 40, noise: float = 3.0) -> Iterator[Frame]:
    """Yield 200 frames; the first is undisturbed."""
    rng = np.random.default_rng(seed)
    ground = np.dstack([texture(rows, cols, seed=seed + one, blur=2.0) for one in range(3)])
    moving, other = sign(side, seed), sign(side, seed, sibling=True)
    on(ground, other, (rows * 0.75, cols * 0.3), 1.0)
    phase = rng.uniform(0, 2 * np.pi)
    for number in range(200):
        turn = 2 * np.pi * number / 100
        middle = rows * (0.5 + 0.3 * np.sin(turn * 1.3 + phase)), cols * (0.5 + 0.33 * np.cos(turn))
        if number in AWAY:
            middle = middle[0], middle[1] + 1.2 * cols * np.sin(np.pi * (number - AWAY[0]) / len(AWAY))
        size = 1 + 0.06 * np.sin(np.pi * number / 100)
        picture = ground.copy()
        seen = float(np.clip((cols - middle[1]) / (size * side) + 0.5, 0, 1))
        on(picture, moving, middle, size)
        top, left = (round(at - side) for at in middle)
        if number in COVERED or number in PARTLY:
            if number in COVERED:
                seen, end = 0.0, max(0, left + 2 * side)
            else:
                seen, end = 0.75, round(middle[1] - side / 4)
            picture[max(top, 0) : top + 2 * side, max(left, 0) : end] = (60, 90, 140)
        gains = 1 + 0.18 * np.sin(turn * np.array([0.7, 0.8, 0.9]))
        lit = picture * gains + 8 * np.sin(turn) + rng.normal(0, noise, picture.shape)
        yield Frame(np.clip(np.rint(lit), 0, 255).astype(np.uint8), middle, size, seen)
