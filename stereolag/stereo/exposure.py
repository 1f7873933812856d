"""How brightly the two cameras saw the same scene, and the right picture as the left camera would have taken it."""

from __future__ import annotations

import cv2
import numpy as np

from stereolag.inputs import Image, as_grey
from stereolag.stereo.correspondences import Correspondences


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
