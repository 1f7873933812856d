"""Ailing pairs for the input doctor to find: swapped, shifted, rotated or darkened."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.assess.diagnosis import FindingCode
from stereolag.assess.remedies import Remedy


def turned(image: np.ndarray, degrees: float, scale: float = 1.0) -> np.ndarray:
    height, width = image.shape[:2]
    turn = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), degrees, scale)
    return cv2.warpAffine(image, turn, (width, height), borderMode=cv2.BORDER_REFLECT)


ILLS = {
    FindingCode.SWAPPED: lambda left, right: (right, left),
    FindingCode.ROWS: lambda left, right: (left, np.roll(right, 3, axis=0)),
    FindingCode.ROTATION: lambda left, right: (left, turned(right, 1.0)),
    FindingCode.EXPOSURE: lambda left, right: (left, np.rint(right * 0.6).astype(np.uint8)),
}
"""Functions that make a healthy 8-bit pair ill."""

REMEDIES = {
    FindingCode.SWAPPED: Remedy.SWAP_SIDES,
    FindingCode.ROWS: Remedy.ALIGN_ROWS,
    FindingCode.ROTATION: Remedy.LEVEL,
    FindingCode.EXPOSURE: Remedy.MATCH_EXPOSURE,
}
"""The remedy for each of them."""
