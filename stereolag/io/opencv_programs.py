"""The program that reproduces a result of StereoBM or StereoSGBM with OpenCV alone."""

from __future__ import annotations

from stereolag.io.programs import file_literal
from stereolag.stereo.opencv import SUBPIXEL, BlockMatcher, StereoSGBM
from stereolag.version import VERSION

_PROGRAM = '''\
"""Measure the disparity of a stereo pair with OpenCV alone, px: positive in front of infinity, NaN where there is none.

Written by stereolag {version}, which it does not need. The images lie beside this file, and so will the result.
"""

from pathlib import Path

import cv2
import numpy as np

FOLDER = Path(__file__).resolve().parent


def grey_image(name):
    image = cv2.imread(str(FOLDER / name), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise SystemExit(f"{{name}} is not beside this file, or it is no image.")
    return image if image.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(image[:, :, :3]), cv2.COLOR_BGR2GRAY)


left, right = grey_image({left}), grey_image({right})
if left.dtype != np.uint8:  # OpenCV matches 8 bits: the common range, less 0.1 % at each end, spread over 0..255
    low, high = np.percentile(np.stack([left, right]), (0.1, 99.9))
    scale = 255 / max(float(high) - float(low), 1e-30)
    left, right = (
        np.clip(np.rint((image.astype(np.float64) - low) * scale), 0, 255).astype(np.uint8) for image in (left, right)
    )

{matcher}
raw = matcher.compute(left, right)  # the disparity × {subpixel}; (minDisparity - 1) * {subpixel} where there is none
disparity = np.where(raw > {none}, raw.astype(np.float32) / {subpixel}, np.float32(np.nan))

np.save(FOLDER / "disparity.npy", disparity)
print(f"{{np.isfinite(disparity).mean():.1%}} of the pixels have a disparity")
'''


def opencv_script(matcher: BlockMatcher, left_name: str, right_name: str) -> str:
    """Return a Python program that measures the same disparities with ``cv2`` and ``numpy`` alone, bit for bit.

    The program reads the two images beside it, and writes ``disparity.npy`` there.

    Parameters
    ----------
    matcher
        StereoBM or StereoSGBM; every setting is written out under OpenCV's name.
    left_name, right_name
        The names of the two files, PNG, or TIFF with grey floats; folders in them are dropped.
    """
    return _PROGRAM.format(
        version=VERSION,
        left=file_literal(left_name),
        right=file_literal(right_name),
        matcher=_semi_global(matcher) if isinstance(matcher, StereoSGBM) else _block_matching(matcher),
        none=(matcher.min_disparity - 1) * SUBPIXEL,
        subpixel=SUBPIXEL,
    )


def _block_matching(matcher: BlockMatcher) -> str:
    """Return the lines that make OpenCV's StereoBM, which takes most of its settings one by one."""
    lines = [f"matcher = cv2.StereoBM.create(numDisparities={matcher.num_disparities}, blockSize={matcher.block_size})"]
    for name, value in matcher:
        if name not in ("num_disparities", "block_size"):
            other = matcher.other_name(name)
            lines.append(f"matcher.set{other[0].upper()}{other[1:]}({value})")
    return "\n".join(lines)


def _semi_global(matcher: StereoSGBM) -> str:
    arguments = matcher.opencv_arguments() | {"mode": f"cv2.{matcher.opencv_mode}"}
    return "\n".join(
        ["matcher = cv2.StereoSGBM.create(", *(f"    {name}={arguments[name]}," for name in arguments), ")"]
    )
