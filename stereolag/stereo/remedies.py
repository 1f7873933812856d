"""What mends a pair of which the input doctor found that something is wrong."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.inputs import Image
from stereolag.stereo.correspondences import Correspondences, find_correspondences
from stereolag.stereo.exposure import exposed_alike
from stereolag.stereo.findings import FEWEST_MATCHES, Ailment

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
