"""A pair packed for window matching in the browser: both images in grey, lossless, and the ground truth."""

from __future__ import annotations

import json

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import FloatMap
from stereolag.core.inputs import Image, as_eight_bit, as_grey

TRUTH_SCALE = 64
"""Steps of the ground truth per px."""

TRUTH_ZERO = 512
"""Offset added to the ground truth, px, to make it positive; values that do not fit count as unknown."""

FASTEST_COMPRESSION = 1


def packed_grey_pair(left: Image, right: Image, truth: FloatMap | None, *, name: str, digest: str) -> bytes:
    """Return a pair as bytes: the length of a JSON header, the header, and the PNGs it points to.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) checked images of the same size and dtype. 8-bit values are kept unchanged.
    truth
        (H, W) disparities, px, NaN = unknown; None if there is no ground truth. Sent as a PNG whose red and green are
        the high and the low byte.
    name, digest
        Name of the place, and digest of the pair, in the browser.
    """
    grey = as_eight_bit(as_grey(left), as_grey(right))
    parts = [_png(grey[0]), _png(grey[1])]
    if truth is not None:
        parts.append(_png(_as_colours(truth)))
    ends = np.cumsum([len(part) for part in parts]).tolist()
    places = [(end - len(part), len(part)) for end, part in zip(ends, parts, strict=True)]
    header = {
        "name": name,
        "digest": digest,
        "rows": left.shape[0],
        "cols": left.shape[1],
        "left": places[0],
        "right": places[1],
        "truth": places[2] if truth is not None else None,
    }
    text = json.dumps(header).encode()
    return len(text).to_bytes(4, "little") + text + b"".join(parts)


def _as_colours(truth: FloatMap) -> npt.NDArray[np.uint8]:
    """Return the code of every disparity as (H, W, 3) uint8 BGR, 0 if it is unknown or does not fit."""
    codes = np.rint((truth.astype(np.float64) + TRUTH_ZERO) * TRUTH_SCALE)
    fits = (codes > 0) & (codes < 2**16)
    high, low = np.divmod(np.where(fits, codes, 0).astype(np.uint16), 256)
    return np.stack([np.zeros_like(low), low, high], axis=-1).astype(np.uint8)


def _png(pixels: npt.NDArray[np.uint8]) -> bytes:
    _, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, FASTEST_COMPRESSION])
    return data.tobytes()
