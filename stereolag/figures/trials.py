"""The degraded part of an image, with the template's known place and the place a method found."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.core.arrays import Rgb
from stereolag.core.inputs import Image
from stereolag.figures.pictures import FRAME, as_rgb, jpeg
from stereolag.templates.trials import Trial

WHITE, BLACK = (255, 255, 255), (0, 0, 0)


def trial_jpeg(part: Image, trial: Trial, place: tuple[int, int], shape: tuple[int, int]) -> bytes:
    """Return the part as a JPEG: a thin white frame at the known place, a bold one where the template was found.

    Parameters
    ----------
    part
        The part searched.
    trial
        Result of a method; a miss has no bold frame.
    place
        True (row, col) of the template's top-left pixel.
    shape
        (height, width) of the template.
    """
    shown = np.ascontiguousarray(as_rgb(part)).copy()
    thin = max(2, shown.shape[1] // 300)
    _frame(shown, place, shape, thin, WHITE, BLACK)
    if trial.outcome in ("right", "elsewhere") and trial.row is not None and trial.col is not None:
        _frame(shown, (trial.row, trial.col), shape, 3 * thin, FRAME, WHITE)
    return jpeg(shown)


def _frame(
    picture: Rgb,
    place: tuple[int, int],
    shape: tuple[int, int],
    thick: int,
    colour: tuple[int, ...],
    rim: tuple[int, ...],
) -> None:
    (row, col), (height, width) = place, shape
    top_left, bottom_right = (col - 1, row - 1), (col + width, row + height)
    cv2.rectangle(picture, top_left, bottom_right, rim, thick + 2)
    cv2.rectangle(picture, top_left, bottom_right, colour, thick)
