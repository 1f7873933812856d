"""What mends a pair of which the input doctor found that something is wrong."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.doctor.correspondences import Correspondences, find_correspondences
from stereolag.doctor.findings import FEWEST_MATCHES, Ailment
from stereolag.inputs import Image, as_grey

REMEDIES = (Ailment.SWAPPED, Ailment.ROWS, Ailment.ROTATION, Ailment.EXPOSURE)
"""The ailments that another pair of pictures cures, in the order in which they should be mended."""


def apply_remedy(left: Image, right: Image, ailment: Ailment) -> tuple[Image, Image]:
    """Return the pair mended of one ailment.

    The left image stays as it is, except that swapped sides change places: what is known of its pixels still holds.
    Only the remedy against rotation makes depth relative, for it bends the right view with no regard to the cameras.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    ailment
        One of ``REMEDIES``.

    Raises
    ------
    ValueError
        An ailment that no other picture cures, or too few sure matches to tell how the views lie.
    """
    if ailment == Ailment.SWAPPED:
        return right, left
    if ailment == Ailment.ROWS:
        return left, rows_aligned(left, right)
    if ailment == Ailment.ROTATION:
        return left, levelled(left, right)
    if ailment == Ailment.EXPOSURE:
        return left, exposed_alike(left, right)
    raise ValueError(f"ailment is {ailment}; what can be mended is {', '.join(REMEDIES)}.")


def rows_aligned(left: Image, right: Image) -> Image:
    """Return the right image moved up or down, by a fraction of a row if need be, until its rows match the left ones.

    Raises
    ------
    ValueError
        Too few sure matches to tell how the views lie.
    """
    offset = float(np.median(_sure_matches(left, right).dy))
    return _warped(right, np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -offset]]))


def levelled(left: Image, right: Image) -> Image:
    """Return the right image turned, scaled and moved so that its rows match those of the left one.

    The similarity that takes dy away is found from sparse matches and applied about the picture's centre; dx there
    stays as it was. Depth from such a pair is relative: how the cameras stood is not known.

    Raises
    ------
    ValueError
        Too few sure matches to tell how the views lie.
    """
    points = _sure_matches(left, right)
    centre = (np.array(points.shape[::-1]) - 1) / 2
    # Rows of the left picture as a plane over the right one: y_left = p * x + q * y + t about the centre.
    plane = np.column_stack([points.right - centre, np.ones(len(points))])
    (p, q, t), *_ = np.linalg.lstsq(plane, points.left[:, 1] - centre[1], rcond=None)
    turn = np.array([[q, -p, 0.0], [p, q, t]])
    turn[:, 2] += centre - turn[:, :2] @ centre
    return _warped(right, turn)


def _sure_matches(left: Image, right: Image) -> Correspondences:
    points = find_correspondences(left, right)
    if len(points) < FEWEST_MATCHES:
        raise ValueError(
            f"{len(points)} sure matches were found; at least {FEWEST_MATCHES} are needed to align the rows."
        )
    return points


def _warped(image: Image, transform: npt.NDArray[np.float64]) -> Image:
    size = (image.shape[1], image.shape[0])
    return np.asarray(cv2.warpAffine(image, transform, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def exposure(left: Image, right: Image, points: Correspondences | None = None) -> tuple[float, float]:
    """Return gain and offset, in grey levels, of ``right = gain * left + offset``.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one type.
    points
        Where both show the same; without any, the two pictures are compared as a whole.
    """
    greys: list[Image] = [as_grey(image).astype(np.float32) for image in (left, right)]
    if points is None:
        samples = greys
    else:
        samples = [
            cv2.remap(cv2.blur(grey, (5, 5)), where[:, 0], where[:, 1], cv2.INTER_LINEAR).ravel()
            for grey, where in zip(greys, (points.left, points.right), strict=True)
        ]
    deviation = [float(np.std(sample)) for sample in samples]
    gain = deviation[1] / deviation[0] if min(deviation) > 0 else 1.0
    return gain, float(np.mean(samples[1]) - gain * np.mean(samples[0]))


def exposed_alike(left: Image, right: Image) -> Image:
    """Return the right image with its brightness and contrast fitted to the left one's, in its own dtype."""
    gain, offset = exposure(left, right)
    mended = (right.astype(np.float64) - offset) / gain
    if right.ndim == 3 and right.shape[2] == 4:
        mended[:, :, 3] = right[:, :, 3]
    if right.dtype.kind == "f":
        return mended.astype(right.dtype)
    limits = np.iinfo(right.dtype)
    np.clip(np.rint(mended, out=mended), limits.min, limits.max, out=mended)
    return mended.astype(right.dtype)
