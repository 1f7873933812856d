"""Trials of each method, including OpenCV's: whether it still finds a template in a degraded image."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, Final, Literal, get_args

import cv2
import numpy as np
import numpy.typing as npt
from pydantic import Field

from stereolag.core.inputs import Image, as_image, grey_level
from stereolag.core.jobs import COSTS, Estimate, check_memory
from stereolag.core.settings import Settings
from stereolag.templates.patterns import opaque_pixels, pattern_of, same_channels
from stereolag.templates.search import check_fits, match_template
from stereolag.templates.verdict import TemplateMatch

MIN_PART_SHAPE = (480, 640)
"""Least rows and columns of the part; it is also at least twice the template, unless the image is smaller."""


class Degradation(Settings):
    """Changes made to the image, in this order: resize and turn, contrast and brightness, cover, noise."""

    contrast: float = Field(
        default=1.0,
        title="Contrast",
        description="1 leaves the image as it is; at 0.1 all values are close to their mean.",
        ge=0.1,
        le=1,
        json_schema_extra={"step": 0.05},
    )
    brightness: int = Field(
        default=0, title="Brightness", description="Grey levels of 255 added to every pixel.", ge=-120, le=120
    )
    noise: int = Field(
        default=0,
        title="Noise",
        description="Standard deviation of Gaussian noise added to every pixel, grey levels of 255.",
        ge=0,
        le=120,
    )
    turn: float = Field(
        default=0.0,
        title="Turn, degrees",
        description="The image is turned about the template’s centre, counter-clockwise.",
        ge=-45,
        le=45,
        json_schema_extra={"step": 1.0},
    )
    resize: float = Field(
        default=1.0,
        title="Resize",
        description="The image grows or shrinks about the template’s centre by this factor.",
        ge=0.5,
        le=2,
        json_schema_extra={"step": 0.05},
    )
    cover: float = Field(
        default=0.0,
        title="Cover",
        description="Share of the template’s area that a grey box hides, from the bottom up.",
        ge=0,
        le=1,
        json_schema_extra={"step": 0.05},
    )


@dataclass(frozen=True, eq=False)
class DegradedPart:
    """A part of an image after a :class:`Degradation`.

    Attributes
    ----------
    pixels
        (rows, cols) or (rows, cols, 3), of the image's dtype.
    top, left
        Position of its first pixel in the image, px, if nothing is turned or resized.
    row, col
        Top-left pixel, within the part, of a window of the template's size centred on the template.
    """

    pixels: Image
    top: int
    left: int
    row: int
    col: int


def degraded_part(
    image: Image, place: tuple[int, int], shape: tuple[int, int], degradation: Degradation
) -> DegradedPart:
    """Cut out the part of an image around a template's place and degrade it, leaving the template's centre in place.

    Parameters
    ----------
    image
        (rows, cols) or (rows, cols, 3 | 4), checked; its alpha is dropped.
    place
        (row, col) of the template's top-left pixel.
    shape
        (height, width) of the template, px.
    degradation
        Changes to make; the noise is always the same. With all of them at their defaults, no pixel changes.

    Raises
    ------
    ValueError
        A place at which the template is not inside the image.
    """
    (row, col), (height, width) = place, shape
    if row < 0 or col < 0 or row + height > image.shape[0] or col + width > image.shape[1]:
        raise ValueError(
            f"A template of {width} × {height} pixels at row {row}, column {col} does not lie within an image of "
            f"{image.shape[1]} × {image.shape[0]}."
        )
    colours = image[:, :, :3] if image.ndim == 3 else image
    high, wide = part_shape(image.shape, shape)[:2]
    rows = pixels_around(row + height // 2, high, image.shape[0])
    cols = pixels_around(col + width // 2, wide, image.shape[1])
    inside = row - rows.start, col - cols.start
    part = colours[rows, cols]
    if degradation.turn or degradation.resize != 1:
        part = _warped(colours, rows, cols, (row + (height - 1) / 2, col + (width - 1) / 2), degradation)
    return DegradedPart(
        _altered(part, inside, shape, grey_level(colours, colours), degradation), rows.start, cols.start, *inside
    )


def part_shape(image_shape: tuple[int, ...], shape: tuple[int, int]) -> tuple[int, ...]:
    """Return the shape of the part of an image (rows, cols[, channels]) around a template of (height, width)."""
    rows, cols = (
        min(max(least, 2 * side), length)
        for least, side, length in zip(MIN_PART_SHAPE, shape, image_shape, strict=False)
    )
    return (rows, cols, 3) if len(image_shape) == 3 else (rows, cols)


def pixels_around(centre: int, length: int, end: int) -> slice:
    """Return `length` pixels around `centre`, moved or cut to stay within 0 … `end`."""
    start = max(0, min(centre - length // 2, end - length))
    return slice(start, min(end, start + length))


def _warped(
    image: Image, rows: slice, cols: slice, centre: tuple[float, float], degradation: Degradation
) -> npt.NDArray[Any]:
    """Return the part in `rows` and `cols` turned and resized about `centre` (row, col), its rim mirrored."""
    reach = math.hypot(rows.stop - rows.start, cols.stop - cols.start) / degradation.resize
    # Only the visible area is warped: OpenCV refuses images of more than 32767 pixels a side.
    top, left = (max(0, math.floor(middle - reach)) for middle in centre)
    source = np.ascontiguousarray(image[top : math.ceil(centre[0] + reach), left : math.ceil(centre[1] + reach)])
    # Maps a pixel (x, y) of the part to the place in the source that it shows; y points down.
    turn = math.radians(degradation.turn)
    cosine, sine = math.cos(turn) / degradation.resize, math.sin(turn) / degradation.resize
    linear = np.array([[cosine, -sine], [sine, cosine]])
    middle = np.array([centre[1], centre[0]])
    offset = middle - (left, top) - linear @ (middle - (cols.start, rows.start))
    size = cols.stop - cols.start, rows.stop - rows.start
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(source, np.column_stack((linear, offset)), size, flags=flags, borderMode=cv2.BORDER_REFLECT_101)
    )


def _altered(
    part: npt.NDArray[Any], inside: tuple[int, int], shape: tuple[int, int], level: float, degradation: Degradation
) -> Image:
    """Return a part with changed contrast and brightness, covered, and with noise, in its own dtype.

    `level` is one grey level of 255 in the part's units.
    """
    values = part.astype(np.float64)
    mean = float(np.nanmean(values))
    if degradation.contrast != 1 or degradation.brightness:
        values = (values - mean) * degradation.contrast + mean + degradation.brightness * level
    if degradation.cover:
        (row, col), (height, width) = inside, shape
        middle_row, middle_col = row + height / 2, col + width / 2
        half_rows, half_cols = height * degradation.resize / 2, width * degradation.resize / 2
        first = middle_row + half_rows - 2 * half_rows * degradation.cover
        box = (
            slice(max(0, round(first)), max(0, round(middle_row + half_rows))),
            slice(max(0, round(middle_col - half_cols)), max(0, round(middle_col + half_cols))),
        )
        values[box] = mean + degradation.brightness * level
    if degradation.noise:
        values += np.random.default_rng(0).normal(0, degradation.noise * level, values.shape)
    if part.dtype.kind == "u":
        values = np.clip(np.rint(values), 0, np.iinfo(part.dtype).max)
    return values.astype(part.dtype)


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
    """Return whether some pixels of a template are masked out."""
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
    check_fits(large, small)
    opaque = opaque_pixels(small, None if mask is None else as_image(mask, "mask"))
    check_memory(estimate_opencv(large.shape, not opaque.all()))
    searched, colours = same_channels(large, small)
    pattern_of(colours, opaque)  # raises if no correlation is defined
    kind = np.dtype(np.uint8 if searched.dtype == colours.dtype == np.uint8 else np.float32)
    marks: Image | None = None if opaque.all() else opaque.astype(kind)
    given: Image = np.ascontiguousarray(searched, dtype=kind)
    looked_for: Image = np.ascontiguousarray(colours, dtype=kind)
    started = time.perf_counter()
    scores = np.asarray(cv2.matchTemplate(given, looked_for, cv2.TM_CCOEFF_NORMED, mask=marks), dtype=np.float32)
    elapsed_s = time.perf_counter() - started
    defined = np.isfinite(scores)
    undefined = int(np.count_nonzero(~defined))
    if not defined.any():
        return OpenCVSearch(-1, -1, float("nan"), undefined, scores, elapsed_s)
    row, col = divmod(int(np.argmax(np.where(defined, scores, -np.inf))), scores.shape[1])
    return OpenCVSearch(row, col, float(scores[row, col]), undefined, scores, elapsed_s)


TrialMethod = Literal["fft", "sampled", "opencv"]
Outcome = Literal["right", "elsewhere", "missed", "refused"]

PLACE_TOLERANCE: Final = 0.1
"""Tolerance of a template's place, as a share of its shorter side: interpolation moves the peak."""

MIN_TOLERANCE_PX: Final = 2.0


@dataclass(frozen=True)
class Trial:
    """The outcome of one method.

    Attributes
    ----------
    method
        "fft" and "sampled" of :func:`~stereolag.templates.match_template`, or "opencv".
    outcome
        "right": found at its place; "elsewhere": found at another; "missed": no score reaches `min_score`;
        "refused": the method cannot search here.
    row, col
        Top-left pixel of the best place, None if no place has a score.
    score
        Score of that place, -1..1; NaN if there is none.
    elapsed_s
        Seconds the search took.
    refusal
        Why the method cannot search, as a sentence.
    """

    method: TrialMethod
    outcome: Outcome
    row: int | None
    col: int | None
    score: float
    elapsed_s: float
    refusal: str = ""


def try_methods(
    image: Image, template: Image, place: tuple[int, int], *, mask: Image | None = None, min_score: float = 0.5
) -> tuple[Trial, ...]:
    """Search with every method, and compare the best place of each with the known place.

    It is found if its score reaches `min_score`: OpenCV has no other test.

    Parameters
    ----------
    image, template, mask, min_score
        As for :func:`~stereolag.templates.match_template`; `min_score` applies to OpenCV too.
    place
        (row, col) of the template's top-left pixel, the ground truth.
    """
    tolerance = max(MIN_TOLERANCE_PX, PLACE_TOLERANCE * min(template.shape[:2]))

    def judged(method: TrialMethod) -> Trial:
        try:
            best, elapsed_s = _best_place(method, image, template, mask, min_score)
        except ValueError as error:
            return Trial(method, "refused", None, None, math.nan, 0.0, str(error))
        if best is None:
            return Trial(method, "missed", None, None, math.nan, elapsed_s)
        near = math.hypot(best.row - place[0], best.col - place[1]) <= tolerance
        outcome: Outcome = "missed" if best.score < min_score else "right" if near else "elsewhere"
        return Trial(method, outcome, best.row, best.col, best.score, elapsed_s)

    return tuple(judged(method) for method in get_args(TrialMethod))


def _best_place(
    method: TrialMethod, image: Image, template: Image, mask: Image | None, min_score: float
) -> tuple[OpenCVSearch | TemplateMatch | None, float]:
    """Return the best place, None if no place has a score, and the seconds that the search took."""
    if method == "opencv":
        theirs = opencv_search(image, template, mask=mask)
        return theirs if theirs.row >= 0 else None, theirs.elapsed_s
    result = match_template(image, template, method=method, mask=mask, min_score=min_score, seed=0)
    # "sampled" scores few places: below `min_score`, the best of them is no answer.
    return result.best if method == "fft" else next(iter(result.matches), None), result.elapsed_s
