"""Remedies: corrected images for a pair in which the input doctor found a problem."""

from __future__ import annotations

from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.assess.features import FEWEST_MATCHES, Correspondences
from stereolag.assess.orientation import best_rectification, centre_of, find_correspondences, robust_fit
from stereolag.core.inputs import Image, as_grey, as_stereo_pair


class Remedy(StrEnum):
    """The fix for a finding: a corrected pair (:func:`.apply_remedy`), or another search range."""

    SWAP_SIDES = "swap_sides"
    ALIGN_ROWS = "align_rows"
    LEVEL = "level"
    """Rotate and scale the right image until its rows match; depth becomes relative."""
    RECTIFY = "rectify"
    """Rotate both views, and undo a lens distortion if that helps, until rows match; depth becomes relative.
    This is no substitute for a calibration."""
    MATCH_EXPOSURE = "match_exposure"
    SET_RANGE = "set_range"
    """Search the range that the finding suggests: changes the settings, not the images."""


def apply_remedy(left: npt.ArrayLike, right: npt.ArrayLike, remedy: Remedy) -> tuple[Image, Image]:
    """Apply one remedy to a pair.

    The left image is unchanged, so that everything known about its pixels remains valid, except that swapping exchanges
    the images and ``Remedy.RECTIFY`` warps both. That and ``Remedy.LEVEL`` make depth relative, as the cameras are
    unknown.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    remedy
        The remedy of a :class:`~stereolag.assess.diagnosis.Finding`.

    Returns
    -------
    left, right
        The corrected images, of the same size and type.

    Raises
    ------
    ValueError
        If the remedy is ``Remedy.SET_RANGE``, which changes matcher settings rather than images; if too few features
        are matched to find the geometry; or if no rectification from the images alone brings the rows much closer.
    """
    images = as_stereo_pair(left, right)
    match Remedy(remedy):
        case Remedy.SWAP_SIDES:
            return images[1], images[0]
        case Remedy.ALIGN_ROWS:
            return images[0], rows_aligned(*images)
        case Remedy.LEVEL:
            return images[0], levelled(*images)
        case Remedy.RECTIFY:
            return rectified(*images)
        case Remedy.MATCH_EXPOSURE:
            return images[0], exposed_alike(*images)
    raise ValueError(f"remedy is '{remedy}', which changes the search range of a matcher, not an image.")


def rows_aligned(left: Image, right: Image) -> Image:
    """Return the right image shifted vertically, by a fraction of a row if need be, so that its rows match the left's.

    Raises
    ------
    ValueError
        If too few features are matched to find the geometry.
    """
    offset = float(np.median(_enough_matches(left, right).dy))
    return _warped(right, np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -offset]]))


def levelled(left: Image, right: Image) -> Image:
    """Return the right image rotated, scaled and moved so that its rows match those of the left one.

    The similarity transform that removes dy is fitted to sparse matches and applied about the image centre, where dx
    stays unchanged. Depth from such a pair is relative: the pose of the cameras is unknown.

    Raises
    ------
    ValueError
        If too few features are matched to find the geometry.
    """
    points = _enough_matches(left, right)
    centre = centre_of(points.shape)
    # The left image's rows as a plane over the right image: y_left = p * x + q * y + t about the centre.
    plane = np.column_stack([points.right - centre, np.ones(len(points))])
    p, q, t = robust_fit(plane, points.left[:, 1] - centre[1])
    turn = np.array([[q, -p, 0.0], [p, q, t]])
    turn[:, 2] += centre - turn[:, :2] @ centre
    return _warped(right, turn)


def rectified(left: Image, right: Image) -> tuple[Image, Image]:
    """Return both views rotated, and with lens distortion removed if that helps, so that their rows match.

    The model (:class:`~.UncalibratedRectification`) is fitted to sparse matches and used
    only if it brings the rows of held-out matches much closer. Depth from such a pair is relative.

    Raises
    ------
    ValueError
        If too few features are matched, or the rows do not come much closer.
    """
    found = best_rectification(_enough_matches(left, right))
    if found is None:
        raise ValueError(
            "Rotating the images and removing one lens distortion from both aligns their rows hardly better than "
            "moving, rotating and scaling one of them; calibrate the camera."
        )
    return found.applied(left, right)


def _enough_matches(left: Image, right: Image) -> Correspondences:
    points = find_correspondences(left, right)
    if len(points) < FEWEST_MATCHES:
        raise ValueError(
            f"{len(points)} features were matched between the images; at least {FEWEST_MATCHES} are needed to align "
            "their rows."
        )
    return points


def _warped(image: Image, transform: npt.NDArray[np.float64]) -> Image:
    size = (image.shape[1], image.shape[0])
    return np.asarray(cv2.warpAffine(image, transform, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def exposure(left: Image, right: Image, points: Correspondences | None = None) -> tuple[float, float]:
    """Return the gain, and the offset in grey levels, of ``right = gain * left + offset``.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one type.
    points
        Matches at which to compare the images; by default they are compared as a whole.
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
    """Return the right image with its brightness and contrast fitted to the left image's, in its own dtype."""
    gain, offset = exposure(left, right)
    fitted = (right.astype(np.float64) - offset) / gain
    if right.ndim == 3 and right.shape[2] == 4:
        fitted[:, :, 3] = right[:, :, 3]
    if right.dtype.kind == "f":
        return fitted.astype(right.dtype)
    limits = np.iinfo(right.dtype)
    np.clip(np.rint(fitted, out=fitted), limits.min, limits.max, out=fitted)
    return fitted.astype(right.dtype)
