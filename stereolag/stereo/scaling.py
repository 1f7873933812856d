"""The same pair and the same settings in a smaller size."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from annotated_types import Ge, MultipleOf
from pydantic.fields import FieldInfo

from stereolag.inputs import Image
from stereolag.settings import Settings
from stereolag.stereo.matcher import StereoMatcher

FloatMap = npt.NDArray[np.float32]

DIMENSIONS = {
    "window_size": 1,
    "block_size": 1,
    "search_size": 1,
    "num_disparities": 1,
    "min_disparity": 1,
    "vertical": 1,
    "speckle_window_size": 2,
}
"""Settings that are lengths (1) and areas (2) in the picture; all others hold whatever its size."""


def scaled_image(image: Image, factor: float) -> Image:
    """Return an image at `factor` times its size, 0 < factor ≤ 1, each pixel the mean of what it stands for.

    Raises
    ------
    ValueError
        A factor out of these bounds, or one that leaves no pixel.
    """
    return np.asarray(cv2.resize(image, _size(image.shape, factor), interpolation=cv2.INTER_AREA))


def scaled_disparity(disparity: npt.ArrayLike, factor: float) -> FloatMap:
    """Return a (H, W) disparity map for images at `factor` times their size, 0 < factor ≤ 1, in px of that size.

    The nearest pixel is taken, for the mean of a near and a far disparity is the disparity of nothing.

    Raises
    ------
    ValueError
        A factor out of these bounds, or one that leaves no pixel.
    """
    values = np.asarray(disparity, dtype=np.float32)
    width, height = _size(values.shape, factor)
    small = cv2.resize(values, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(small * np.float32(width / values.shape[1]), dtype=np.float32)


def scaled_settings(matcher: StereoMatcher, factor: float) -> StereoMatcher:
    """Return the matcher whose windows and search area cover the same part of images at `factor` times their size.

    Sizes are rounded to what their field allows, the number of disparities upwards: nothing drops out of the search.

    Raises
    ------
    ValueError
        So small that the settings no longer fit together.
    """
    return type(matcher).model_validate(_scaled(matcher, factor))


def _size(shape: tuple[int, ...], factor: float) -> tuple[int, int]:
    """Return (width, height), as OpenCV wants it."""
    width, height = round(shape[1] * factor), round(shape[0] * factor)
    if not 0 < factor <= 1 or min(width, height) < 1:
        raise ValueError(
            f"factor is {factor} for {shape[1]} × {shape[0]} pixels; allowed is above 0 to 1, and a pixel must be left."
        )
    return width, height


def _scaled(settings: Settings, factor: float) -> dict[str, Any]:
    document: dict[str, Any] = {}
    for name, field in type(settings).model_fields.items():
        value = getattr(settings, name)
        if isinstance(value, Settings):
            document[name] = _scaled(value, factor)
        elif name in DIMENSIONS and value is not None:
            document[name] = _rounded(value, value * factor ** DIMENSIONS[name], name, field)
        else:
            document[name] = value
    return document


def _rounded(value: int, wanted: float, name: str, field: FieldInfo) -> int:
    """Return the allowed whole number next to `wanted`, in whole steps from the allowed `value`."""
    declared = {type(one): one for one in field.metadata}
    extra: dict[str, Any] = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    if name == "num_disparities":
        multiple = int(declared[MultipleOf].multiple_of) if MultipleOf in declared else 1
        return max(multiple, int(-(-wanted // multiple)) * multiple)
    step = int(extra.get("step", 1)) if name == "block_size" else 1
    rounded = value - step * round((value - wanted) / step)
    low = int(declared[Ge].ge) if Ge in declared else rounded
    return rounded if rounded >= low else low
