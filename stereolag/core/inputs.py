"""Checks on arrays, made once, where they enter the library."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import DoubleMap, Mask
from stereolag.core.typography import counted

Image: TypeAlias = npt.NDArray[Any]
"""(rows, cols) grey or (rows, cols, 3 | 4) RGB(A); uint8, uint16 or float."""

MAX_ORDINARY_FLOAT = 1e9
"""Floats up to this, and down to its inverse, can be squared and summed over a window in both float types."""

OUTLIER_SHARE = 0.001
"""Share of the brightest and of the darkest pixels that are ignored for the range of an image."""

SAMPLED_PIXELS = 2**16
"""Pixels sampled to find the range of an image, about."""


def as_signal(value: npt.ArrayLike, name: str) -> npt.NDArray[np.float64]:
    """Return `value` as a float64 vector of at least two finite samples that are not all equal.

    Raises
    ------
    ValueError
        Not one-dimensional, fewer than two samples, NaN or infinite samples, or a constant signal.
    """
    return checked_signal(value, name).astype(np.float64, copy=False)


def checked_signal(value: npt.ArrayLike, name: str) -> npt.NDArray[Any]:
    """Return `value` as :func:`as_signal` does, but keep the type of integers and floats, without a copy.

    Raises
    ------
    ValueError
        As for :func:`as_signal`.
    """
    try:
        # Masked values are not samples: as plain arrays, they would be arbitrary numbers.
        given = np.asarray(np.ma.asarray(value, np.float64).filled(np.nan) if np.ma.is_masked(value) else value)
        if np.iscomplexobj(given):
            raise ValueError("a recording is real, and these are complex")
        signal = given if given.dtype.kind in "iuf" else given.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must hold numbers only: {error}") from error
    if signal.ndim != 1:
        raise ValueError(f"{name} has shape {signal.shape}; a recording is one-dimensional, one channel at a time.")
    if signal.size < 2:
        raise ValueError(f"{name} holds {counted(signal.size, 'sample')}; at least 2 are needed.")
    bad = signal.size - int(np.isfinite(signal).sum())
    if bad:
        raise ValueError(
            f"{name} holds {counted(bad, 'NaN or infinite sample')}; every sample must be a finite number."
        )
    if signal.min() == signal.max():
        raise ValueError(f"{name} is constant ({signal[0]:g} throughout); a correlation needs something that varies.")
    return signal


def as_image(value: npt.ArrayLike, name: str, *, gaps: bool = False) -> Image:
    """Return `value` as a (rows, cols) or (rows, cols, 3 | 4) array of uint8, uint16 or float, all finite.

    With `gaps` it may hold pixels without data, and numbers of any range: integers that do not fit become float64, and
    NaN, infinite and far outlying pixels (:data:`MIN_MARK_DISTANCE`) NaN.

    Booleans become uint8 0/255; other integers that fit become uint8 or uint16; float16 becomes float32, and longer
    floats become float64. A single trailing channel axis is dropped; grey with alpha becomes RGBA.

    Raises
    ------
    ValueError
        Another shape, no pixels, a type not used for images, or NaN or infinite pixels.
    """
    image = np.asarray(value)
    if image.ndim == 3 and image.shape[2] in (1, 2):
        image = image[:, :, 0] if image.shape[2] == 1 else image[:, :, [0, 0, 0, 1]]
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in (3, 4)):
        raise ValueError(
            f"{name} has shape {image.shape}; allowed are (rows, cols), (rows, cols, 3) and (rows, cols, 4)."
        )
    if image.size == 0:
        raise ValueError(f"{name} has shape {image.shape}: it holds no pixels.")
    return _with_gaps(image, name) if gaps and image.dtype.kind in "iuf" else _as_pixel_type(image, name)


MIN_MARK_DISTANCE = 3e4
"""Distance from the median, over the median distance, beyond which a pixel is a mark for missing data, like -32768.

Rounding in sums of such numbers would hide the data."""


def _with_gaps(image: Image, name: str) -> Image:
    """Return an image in a pixel type, with NaN where it has no data."""
    if image.dtype in (np.uint8, np.uint16) or (image.dtype.kind in "iu" and image.min() >= 0 and image.max() <= 65535):
        return _as_pixel_type(image, name)
    with np.errstate(over="ignore"):
        wide = image.astype(np.float32 if image.dtype in (np.float16, np.float32) else np.float64)
    known = np.isfinite(wide)
    if not known.any():
        return _as_pixel_type(wide, name)
    sample = wide[known][:: max(1, wide.size // SAMPLED_PIXELS)].astype(np.float64)
    for data in (sample, sample[sample != np.median(sample)]):  # without the mark, if most pixels are marks
        spread = np.median(np.abs(data - np.median(data))) if data.size else 0.0
        if spread > 0:
            known &= np.abs(wide - np.median(data)) <= MIN_MARK_DISTANCE * spread
            break
    return wide if known.all() else np.where(known, wide, wide.dtype.type(np.nan))


def _as_pixel_type(image: Image, name: str) -> Image:
    match image.dtype.kind:
        case _ if image.dtype in (np.uint8, np.uint16):
            return image
        case "b":
            return image.astype(np.uint8) * 255
        case "i" | "u":
            low, high = int(image.min()), int(image.max())
            if low < 0 or high > 65535:
                raise ValueError(f"{name} holds integers from {low} to {high}; allowed are 0 to 65535, or floats.")
            return image.astype(np.uint8 if high < 256 else np.uint16)
        case "f":
            if image.dtype not in (np.float32, np.float64):
                with np.errstate(over="ignore"):  # values too large for float64 are counted below
                    image = image.astype(np.float32 if image.dtype == np.float16 else np.float64)
            bad = image.size - int(np.isfinite(image).sum())
            if bad:
                raise ValueError(f"{name} holds {bad} NaN or infinite pixels; every pixel must be a finite number.")
            return image
    raise ValueError(f"{name} has type {image.dtype}; allowed are uint8, uint16 and float.")


def as_grey(image: Image) -> Image:
    """Return the luminance (rows, cols) of a checked image, in the image's own dtype (Rec. 601 weights, as OpenCV)."""
    if image.ndim == 2:
        return image
    colour = np.ascontiguousarray(image[:, :, :3])
    if colour.dtype == np.float64:
        return np.asarray(colour @ np.array([0.299, 0.587, 0.114]))
    return np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY))


def as_stereo_pair(left: npt.ArrayLike, right: npt.ArrayLike) -> tuple[Image, Image]:
    """Return both images of a stereo pair, checked, with one dtype and one size.

    Raises
    ------
    ValueError
        An image that :func:`as_image` refuses, images of different sizes, or an integer and a float image.
    """
    return as_image_pair(left, right, ("left", "right"))


def check_window(window_size: int, shape: tuple[int, ...]) -> None:
    """Raise ValueError if a window does not fit into an image of a shape."""
    rows, cols = shape[:2]
    if not 1 <= window_size <= min(rows, cols):
        raise ValueError(
            f"window_size is {window_size} px and the images are {cols} × {rows}; the window must fit into them."
        )


def as_image_pair(first: npt.ArrayLike, second: npt.ArrayLike, names: tuple[str, str]) -> tuple[Image, Image]:
    """Return two images, checked, with one dtype and one size; `names` are their names in errors.

    Raises
    ------
    ValueError
        An image that :func:`as_image` refuses, images of different sizes, or an integer and a float image.
    """
    name_1, name_2 = names
    images = as_images(first, second, names)
    (rows_1, cols_1), (rows_2, cols_2) = (image.shape[:2] for image in images)
    if (rows_1, cols_1) != (rows_2, cols_2):
        raise ValueError(
            f"{name_1} is {cols_1} × {rows_1} and {name_2} is {cols_2} × {rows_2} pixels; "
            "both images must have the same size."
        )
    if images[0].dtype != images[1].dtype:
        raise ValueError(
            f"{name_1} holds {images[0].dtype} and {name_2} {images[1].dtype} pixels; "
            "both images must have the same type."
        )
    return images


def as_images(
    first: npt.ArrayLike, second: npt.ArrayLike, names: tuple[str, str], *, gaps: bool = False
) -> tuple[Image, Image]:
    """Return two images, checked; of one type if they are given in one, whatever their brightness.

    `gaps` is passed on to :func:`as_image`.

    Raises
    ------
    ValueError
        An image that :func:`as_image` refuses.
    """
    given = np.asarray(first), np.asarray(second)
    image_1, image_2 = as_image(given[0], names[0], gaps=gaps), as_image(given[1], names[1], gaps=gaps)
    if given[0].dtype == given[1].dtype and image_1.dtype != image_2.dtype:
        # `as_image` converts other integer types to uint8 if no value is above 255, else to uint16.
        common = np.result_type(image_1, image_2)
        return image_1.astype(common), image_2.astype(common)
    return image_1, image_2


def check_positive(value: float, name: str, unit: str = "") -> None:
    """Raise ValueError for a number, in this unit, that is not finite and above 0."""
    if not (value > 0 and math.isfinite(value)):
        given = f"{name} is {value} {unit}".rstrip()
        raise ValueError(f"{given}; allowed are finite numbers above 0.")


MIN_GREY_LEVELS = 128
"""Evenly spaced levels in use from which on they are grey levels of 8 bits; fewer are stretched."""

MAX_GREY_LEVELS = 256
"""Grey levels of 8 bits; more levels in use are compressed to 255."""


def grey_scale(left: Image, right: Image) -> tuple[float, float]:
    """Return the value of black and the height of one grey level (of 255), for two checked images of one type.

    For uint8 they are 0 and 1. Other images use only a part of their type's range: cameras leave bits empty, and
    sensors count from a pedestal. A level is a 255th of the range in use, or the step between the values if 128 to 256
    evenly spaced ones are in use: 8 bits in another form. Both images share the scale, so that their exposures stay as
    different as they are. The 0.1 % brightest and darkest pixels are ignored, so that a hot pixel has no influence; so
    is a mark for pixels without data: a value at one end, of more pixels than these, that is farther from the others
    than they are from each other.
    """
    if left.dtype == np.uint8:
        return 0.0, 1.0
    stride = max(1, math.isqrt(left.size // SAMPLED_PIXELS))
    sample = np.concatenate([image[::stride, ::stride].ravel() for image in (left, right)])
    values, counts = np.unique(sample[np.isfinite(sample)], return_counts=True)
    if values.size == 0:
        return 0.0, 1.0
    values = values.astype(np.float64)
    for end, rest in ((0, slice(1, None)), (-1, slice(None, -1))):
        if values.size > MAX_DRAWN_LEVELS and counts[end] > OUTLIER_SHARE * sample.size:
            others = _without_outliers(values[rest], counts[rest])
            if np.abs(values[end] - others).min() > np.ptp(others) > 0:
                values, counts = values[rest], counts[rest]
    used = _without_outliers(values, counts)
    black, span = float(used[0]), float(np.ptp(used))
    if 0 < span < 2**53 and (used == np.rint(used)).all():
        step = float(np.gcd.reduce(np.diff(used).astype(np.int64)))
        unused = MAX_GREY_LEVELS - 1 - span / step
        if 0 <= unused <= MAX_GREY_LEVELS - MIN_GREY_LEVELS:
            return black - unused // 2 * step, step
    if span == 0:
        black = min(float(np.nanmin(left)), float(np.nanmin(right)))
        span = max(float(np.nanmax(left)), float(np.nanmax(right))) - black
    return black, span / 255 or 1.0


MAX_DRAWN_LEVELS = 16
"""Levels of a drawn image, at most: in these, no value is a mark for missing data."""


def _without_outliers(values: DoubleMap, counts: npt.NDArray[np.intp]) -> DoubleMap:
    """Return the sorted values without the outliers at either end."""
    below = np.cumsum(counts)
    ignored = int(OUTLIER_SHARE * below[-1])
    first, last = np.searchsorted(below, (ignored, below[-1] - ignored - 1), side="right")
    return values[first : last + 1]


def grey_level(left: Image, right: Image) -> float:
    """Return the height of one grey level (of 255) in two checked images of one type: :func:`grey_scale`."""
    return grey_scale(left, right)[1]


def rescale_extreme_floats(left: Image, right: Image) -> tuple[Image, Image]:
    """Return float images, scaled by a power of two if the squares of their pixels would overflow or vanish.

    Only the unit changes; other images are returned unchanged.
    """
    if left.dtype.kind != "f":
        return left, right
    largest = max(float(np.abs(left).max()), float(np.abs(right).max()))
    if largest == 0 or MAX_ORDINARY_FLOAT**-1 <= largest <= MAX_ORDINARY_FLOAT:
        return left, right
    exponent = -round(float(np.log2(largest)))
    scaled = [np.ldexp(image.astype(np.float64), exponent) for image in (left, right)]
    return scaled[0], scaled[1]


def as_eight_bit(left: Image, right: Image) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Return both images in grey levels of 255 (:func:`grey_scale`), as uint8."""
    if left.dtype == np.uint8:
        return left, right
    black, level = grey_scale(left, right)
    levels = [
        np.clip(np.rint((image.astype(np.float64) - black) / level), 0, 255).astype(np.uint8) for image in (left, right)
    ]
    return levels[0], levels[1]


def in_eight_bits(left: Image, right: Image) -> tuple[Image, Image]:
    """Return both images as uint8, without alpha, if they are 8 bits in 16; otherwise unchanged.

    They are if all their values are black plus up to 255 times their grey level (:func:`grey_scale`), a whole number:
    8 bits shifted up, spread over 16 bits, or counted from a pedestal.
    """
    if left.dtype != np.uint16:
        return left, right
    colours = [image if image.ndim == 2 else image[:, :, :3] for image in (left, right)]
    step = grey_level(colours[0], colours[1])
    lowest, highest = min(int(image.min()) for image in colours), max(int(image.max()) for image in colours)
    if step != int(step) or highest - lowest > (MAX_GREY_LEVELS - 1) * step:
        return left, right
    level = np.uint16(step)
    black = np.uint16(0 if highest < MAX_GREY_LEVELS * step and lowest % step == 0 else lowest)
    if any((np.remainder(image - black, level) != 0).any() for image in colours):
        return left, right
    first, second = (((image - black) // level).astype(np.uint8) for image in colours)
    return first, second


MIN_BORDER_PIXELS = 64
"""Pixels of a black border, at least; fewer are a dark detail at the edge of the picture."""


def with_border_transparent(image: Image) -> Image:
    """Return a checked image as RGBA with alpha 0 in its black borders; unchanged if it has none.

    Rectification, rotation and projection leave such borders. They are exactly 0, unlike dark parts of a photograph.
    """
    if image.ndim == 3 and image.shape[2] == 4:
        return image
    rim = (image[0], image[-1], image[:, 0], image[:, -1])
    if not any((line.reshape(len(line), -1).max(axis=1) == 0).any() for line in rim):
        return image
    lightest = image if image.ndim == 2 else image.max(axis=2)
    count, labels, sizes, _ = cv2.connectedComponentsWithStats((lightest == 0).astype(np.uint8), connectivity=8)
    rim_labels = np.concatenate((labels[0], labels[-1], labels[:, 0], labels[:, -1]))
    at_rim = np.isin(np.arange(count), rim_labels) & (sizes[:, cv2.CC_STAT_AREA] >= MIN_BORDER_PIXELS)
    at_rim[0] = False  # the label of all other pixels
    border = at_rim[labels]
    if not border.any() or border.all():
        return image
    alpha = np.where(border, 0, np.iinfo(image.dtype).max if image.dtype.kind == "u" else 1).astype(image.dtype)
    colours = [image] * 3 if image.ndim == 2 else [*np.moveaxis(image, 2, 0)]
    return np.dstack([*colours, alpha])


def transparent(image: Image) -> Mask | None:
    """Return where a checked image has alpha 0; None if that is nowhere or everywhere."""
    if image.ndim == 2 or image.shape[2] < 4:
        return None
    outside = np.asarray(image[:, :, 3] == 0)
    return outside if outside.any() and not outside.all() else None


def local_deviation(image: Image, size: int) -> DoubleMap:
    """Return the standard deviation of the `size` × `size` window around every pixel, in the image's own units.

    Computed from float64 sums about the mean of the whole image; a window of equal pixels has exactly 0, despite
    rounding in its sums. The image is mirrored at its borders.

    Parameters
    ----------
    image
        (H, W) uint8, uint16 or float.
    size
        Side of the window, px; if it is even, the larger half is above and to the left of the pixel.
    """
    centred: DoubleMap = image.astype(np.float64)
    centred = centred - np.rint(centred.mean())
    window = (size, size)
    mean, square = cv2.blur(centred, window), cv2.sqrBoxFilter(centred, cv2.CV_64F, window)
    variance: DoubleMap = np.subtract(square, mean * mean)
    element, border = np.ones(window, np.uint8), cv2.BORDER_REFLECT_101
    lowest = cv2.erode(image, element, borderType=border)
    variance[lowest == cv2.dilate(image, element, borderType=border)] = 0
    return np.asarray(np.sqrt(np.maximum(variance, 0)))


FLAT_TEXTURE = 1e-6
"""Standard deviation, grey levels of 255, up to which a window is flat even without a texture test."""

FLAT_WHOLE = 0.25
"""Energy about the mean up to which a window of whole numbers is flat: the smallest non-zero energy is a half."""

FLAT_SHARE = 1e-11
"""Energy per pixel, as a share of the largest pixel squared, that float64 sums cannot distinguish from 0."""


def flat_energy(count: int, brightest: float, *, exact: bool) -> float:
    """Return the energy, the sum of squared deviations, up to which a window of `count` pixels is flat.

    Parameters
    ----------
    count
        Number of pixels.
    brightest
        Largest absolute value of the images.
    exact
        Whether the sums are of whole numbers, without rounding.
    """
    return FLAT_WHOLE if exact else FLAT_SHARE * count * brightest**2
