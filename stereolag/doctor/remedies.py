"""Remedies: another pair of images for one on which the input doctor found something wrong."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.doctor.correspondences import find_correspondences
from stereolag.doctor.features import Correspondences
from stereolag.doctor.findings import FEWEST_MATCHES, Remedy
from stereolag.doctor.rows import centre_of, robust_fit, straightened
from stereolag.inputs import Image, as_grey, as_stereo_pair


def apply_remedy(left: npt.ArrayLike, right: npt.ArrayLike, remedy: Remedy) -> tuple[Image, Image]:
    """Return the pair after one remedy.

    The left image stays as it is, so that everything known about its pixels still holds; but swapped sides change
    places, and ``Remedy.RECTIFY`` warps both. That and ``Remedy.LEVEL`` make depth relative, for they know no cameras.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    remedy
        That of a :class:`~stereolag.doctor.findings.Finding`.

    Returns
    -------
    left, right
        Of the same size and type.

    Raises
    ------
    ValueError
        ``Remedy.SET_RANGE``, which changes the settings of a matcher and no image; too few matched features to tell
        how the views lie; or rows that no rectification from the images alone brings much closer.
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
    raise ValueError(f"remedy is '{remedy}', which changes the search range of a matcher and no image.")


def rows_aligned(left: Image, right: Image) -> Image:
    """Return the right image moved up or down, by a fraction of a row if need be, until its rows match the left ones.

    Raises
    ------
    ValueError
        Too few matched features to tell how the views lie.
    """
    offset = float(np.median(_enough_matches(left, right).dy))
    return _warped(right, np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -offset]]))


def levelled(left: Image, right: Image) -> Image:
    """Return the right image rotated, scaled and moved so that its rows match those of the left one.

    The similarity that removes dy is fitted to sparse matches and applied about the image's centre; dx there stays as
    it was. Depth from such a pair is relative: how the cameras stood is not known.

    Raises
    ------
    ValueError
        Too few matched features to tell how the views lie.
    """
    points = _enough_matches(left, right)
    centre = centre_of(points)
    # Rows of the left image as a plane over the right one: y_left = p * x + q * y + t about the centre.
    plane = np.column_stack([points.right - centre, np.ones(len(points))])
    p, q, t = robust_fit(plane, points.left[:, 1] - centre[1])
    turn = np.array([[q, -p, 0.0], [p, q, t]])
    turn[:, 2] += centre - turn[:, :2] @ centre
    return _warped(right, turn)


def rectified(left: Image, right: Image) -> tuple[Image, Image]:
    """Return both images turned, and freed of a lens distortion where that helps, so that their rows match.

    Fitted to sparse matches, and taken only where it brings matches that it was not fitted to much closer: see
    :class:`~stereolag.doctor.uncalibrated.UncalibratedRectification`. Depth from such a pair is relative.

    Raises
    ------
    ValueError
        Too few matched features, or rows that do not come much closer.
    """
    found = straightened(_enough_matches(left, right))
    if found is None:
        raise ValueError(
            "Turning the images and freeing them of one lens distortion brings their rows not much closer than moving, "
            "rotating and scaling one of them; calibrate the camera."
        )
    return found.model.applied(left, right)


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
    """Return gain and offset, in grey levels, of ``right = gain * left + offset``.

    Parameters
    ----------
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one type.
    points
        Where both show the same; without any, the two images are compared as a whole.
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
    fitted = (right.astype(np.float64) - offset) / gain
    if right.ndim == 3 and right.shape[2] == 4:
        fitted[:, :, 3] = right[:, :, 3]
    if right.dtype.kind == "f":
        return fitted.astype(right.dtype)
    limits = np.iinfo(right.dtype)
    np.clip(np.rint(fitted, out=fitted), limits.min, limits.max, out=fitted)
    return fitted.astype(right.dtype)
