"""The same search by OpenCV: ``matchTemplate`` with TM_CCOEFF_NORMED, masked if the template has a mask."""

from __future__ import annotations

import time
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image, as_image
from stereolag.core.jobs import COSTS, Estimate, check_memory
from stereolag.templates.patterns import alike, opaque_pixels, pattern_of


@dataclass(frozen=True, eq=False)
class OpenCVSearch:
    """The highest score of ``matchTemplate``.

    Attributes
    ----------
    row, col
        Top-left pixel of the place with the highest defined score; -1 if there is none.
    score
        That score, NaN if there is none.
    undefined
        Number of places whose score is NaN or infinite. A single NaN makes ``cv2.minMaxLoc`` return no place.
    score_map
        (rows - height + 1, cols - width + 1) float32, as returned by OpenCV.
    elapsed_s
        Seconds ``matchTemplate`` took.
    """

    row: int
    col: int
    score: float
    undefined: int
    score_map: npt.NDArray[np.float32]
    elapsed_s: float


def estimate_opencv(image_shape: tuple[int, ...], masked: bool) -> Estimate:
    """Return the memory and time that :func:`opencv_search` needs for an image of (rows, cols[, channels])."""
    pixels = image_shape[0] * image_shape[1]
    channels = min(image_shape[2], 3) if len(image_shape) == 3 else 1
    return COSTS["template by OpenCV"].estimate(values=channels * pixels, pixels=pixels, masked=pixels * masked)


def is_masked(template: Image, mask: Image | None) -> bool:
    """Return whether some pixels of a template are excluded."""
    return not bool(opaque_pixels(template, mask).all())


def opencv_search(image: npt.ArrayLike, template: npt.ArrayLike, *, mask: npt.ArrayLike | None = None) -> OpenCVSearch:
    """Find a template with OpenCV's ``matchTemplate`` (TM_CCOEFF_NORMED), from the same input as `match_template`.

    Images of 16 bits or doubles are converted to float32, as OpenCV accepts nothing else.

    Parameters
    ----------
    image, template, mask
        As for :func:`stereolag.templates.match_template`.

    Raises
    ------
    ValueError
        Anything ``match_template`` refuses: arrays that are not images, a template larger than the image, a mask of
        another size or without a marked pixel, a constant template; more memory needed than one job may take.
    """
    large, small = as_image(image, "image"), as_image(template, "template")
    if small.shape[0] > large.shape[0] or small.shape[1] > large.shape[1]:
        raise ValueError(
            f"template is {small.shape[1]} × {small.shape[0]} pixels and image {large.shape[1]} × "
            f"{large.shape[0]}; the template must fit into the image."
        )
    opaque = opaque_pixels(small, None if mask is None else as_image(mask, "mask"))
    check_memory(estimate_opencv(large.shape, not opaque.all()))
    searched, colours = alike(large, small)
    pattern_of(colours, opaque)  # raises if no correlation is defined
    kind = np.dtype(np.uint8 if searched.dtype == colours.dtype == np.uint8 else np.float32)
    marks: Image | None = None if opaque.all() else opaque.astype(kind)
    given: Image = np.ascontiguousarray(searched, dtype=kind)
    looked_for: Image = np.ascontiguousarray(colours, dtype=kind)
    started = time.perf_counter()
    scores = np.asarray(cv2.matchTemplate(given, looked_for, cv2.TM_CCOEFF_NORMED, mask=marks), dtype=np.float32)
    elapsed_s = time.perf_counter() - started
    defined = np.isfinite(scores)
    undefined = int(scores.size - np.count_nonzero(defined))
    if undefined == scores.size:
        return OpenCVSearch(-1, -1, float("nan"), undefined, scores, elapsed_s)
    best = int(np.argmax(np.where(defined, scores, -np.inf)))
    row, col = divmod(best, scores.shape[1])
    return OpenCVSearch(row, col, float(scores[row, col]), undefined, scores, elapsed_s)
