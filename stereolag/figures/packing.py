"""Lossless packing of pictures and scores for scripts in the browser."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Rgb

SCORE_STEPS = 30_000
"""Steps of a score from 0 to 1; code 0 means no score."""


def packed_pictures(header: Mapping[str, Any], pictures: Sequence[Rgb | bytes]) -> bytes:
    """Return pictures as bytes: the length of a JSON header, the header, and a PNG for each.

    Parameters
    ----------
    header
        Further data for the browser. Added are `digest`, which identifies the content, `steps` (:data:`SCORE_STEPS`),
        and `parts`: start and length of each PNG after the header.
    pictures
        (rows, cols, 3) uint8 RGB arrays, or PNGs.
    """
    parts = [picture if isinstance(picture, bytes) else _png(picture) for picture in pictures]
    ends = np.cumsum([len(part) for part in parts]).tolist()
    places = [(end - len(part), len(part)) for end, part in zip(ends, parts, strict=True)]
    said = json.dumps(header)
    digest = hashlib.sha256(said.encode() + b"".join(parts)).hexdigest()
    text = json.dumps({**header, "digest": digest, "steps": SCORE_STEPS, "parts": places}).encode()
    return len(text).to_bytes(4, "little") + text + b"".join(parts)


def scores_as_colours(scores: npt.NDArray[np.floating[Any]]) -> Rgb:
    """Return scores of -1..1 as (rows, cols, 3) uint8: red and green are the high and the low byte of the code."""
    codes = np.rint((scores + 1) * SCORE_STEPS) + 1
    high, low = np.divmod(np.where(np.isnan(scores), 0, codes).astype(np.uint16), 256)
    return np.stack([high, low, np.zeros_like(low)], axis=-1).astype(np.uint8)


def _png(picture: Rgb) -> bytes:
    _, data = cv2.imencode(".png", np.ascontiguousarray(picture[:, :, ::-1]))
    return data.tobytes()
