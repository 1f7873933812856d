"""Ailing pairs for the input doctor: swapped, shifted, rotated, darkened; seen by lenses and by rotated cameras."""

import cv2
import numpy as np

from stereolag.assess.findings import FindingCode, Remedy


def turned(image: np.ndarray, degrees: float, scale: float = 1.0) -> np.ndarray:
    height, width = image.shape[:2]
    turn = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), degrees, scale)
    return cv2.warpAffine(image, turn, (width, height), borderMode=cv2.BORDER_REFLECT)


def darkened(image: np.ndarray) -> np.ndarray:
    return np.rint(image * 0.6).astype(np.uint8)


ILLS = {
    FindingCode.SWAPPED: lambda left, right: (right, left),
    FindingCode.ROWS: lambda left, right: (left, np.roll(right, 3, axis=0)),
    FindingCode.ROTATION: lambda left, right: (left, turned(right, 1.0)),
    FindingCode.EXPOSURE: lambda left, right: (left, darkened(right)),
}
"""Functions that make a healthy 8-bit pair ill."""

REMEDIES = {
    FindingCode.SWAPPED: Remedy.SWAP_SIDES,
    FindingCode.ROWS: Remedy.ALIGN_ROWS,
    FindingCode.ROTATION: Remedy.LEVEL,
    FindingCode.EXPOSURE: Remedy.MATCH_EXPOSURE,
}
"""The remedy for each of them."""


def camera(shape: tuple[int, int]) -> np.ndarray:
    """Return the matrix of a camera with a focal length of one width."""
    height, width = shape
    return np.array([[width, 0, (width - 1) / 2], [0, width, (height - 1) / 2], [0, 0, 1.0]])


def barrel(image: np.ndarray, k1: float) -> np.ndarray:
    """Return an image as seen by a lens with OpenCV's k1 and a focal length of one image width."""
    height, width = image.shape[:2]
    seen_by = camera((height, width))
    maps = cv2.initInverseRectificationMap(
        seen_by, np.array([k1, 0, 0, 0]), None, seen_by, (width, height), cv2.CV_32FC1
    )
    return cv2.remap(image, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def through_barrel(points: np.ndarray, shape: tuple[int, int], k1: float) -> np.ndarray:
    """Return where that lens maps points, (n, 2) (x, y), px."""
    centre = (np.array(shape[::-1]) - 1) / 2
    straight = (points - centre) / shape[1]
    return straight * (1 + k1 * (straight**2).sum(axis=1, keepdims=True)) * shape[1] + centre


def turning(shape: tuple[int, int], turn: tuple[float, float, float]) -> np.ndarray:
    """Return the homography of a camera with a focal length of one width, rotated about x, y and z, radians."""
    seen_by = camera(shape)
    return seen_by @ cv2.Rodrigues(np.array(turn, dtype=float))[0] @ np.linalg.inv(seen_by)


def turned_camera(image: np.ndarray, turn: tuple[float, float, float]) -> np.ndarray:
    """Return an image as seen by a camera rotated about x, y and z, radians."""
    height, width = image.shape[:2]
    return cv2.warpPerspective(image, turning((height, width), turn), (width, height), borderMode=cv2.BORDER_REFLECT)
