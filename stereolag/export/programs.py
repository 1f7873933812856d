"""A result as the short program that makes it again."""

from __future__ import annotations

import math
import re

from stereolag.export.constructors import constructor, imports, text_literal
from stereolag.stereo.matcher import StereoMatcher
from stereolag.version import VERSION

_PROGRAM = '''\
"""Measure the disparity of a stereo pair, px: positive in front of infinity, NaN where there is none.

Written by stereolag {version}, which it needs. The images lie beside this file, and so will the results.
"""

from pathlib import Path

{imports}

FOLDER = Path(__file__).resolve().parent

{images}

{matcher}
result = matcher.compute(left, right)

np.save(FOLDER / "disparity.npy", result.disparity)
(FOLDER / "disparity.pfm").write_bytes(pfm(result.disparity))
print(f"{{result.coverage:.1%}} of the pixels have a disparity; it took {{result.elapsed_s:.2f}} s")
'''


def script(
    matcher: StereoMatcher,
    left_name: str,
    right_name: str,
    *,
    crop: tuple[int, int] | None = None,
    scale: float = 1.0,
) -> str:
    """Return a Python program that measures the same disparities again, bit for bit.

    It reads the two images beside it, and writes ``disparity.npy`` and ``disparity.pfm`` there.

    Parameters
    ----------
    matcher
        Every setting is written out, so that a later release with other defaults gives the same.
    left_name, right_name
        The names of the two files, for example ``left.png``; folders in them are left out.
    crop
        (rows, cols) that were kept of both images, from the top left; None: all.
    scale
        What the images were resized by after that, by ``cv2.resize`` with ``INTER_AREA``.

    Raises
    ------
    ValueError
        A scale that is not above 0, or a crop that keeps nothing.
    """
    if not (scale > 0 and math.isfinite(scale)):
        raise ValueError(f"scale is {scale}; allowed are finite numbers above 0.")
    if crop is not None and min(crop) < 1:
        raise ValueError(f"crop is {crop}; allowed are whole numbers of rows and columns from 1.")
    return _PROGRAM.format(
        version=VERSION,
        imports="\n".join(_imports(matcher, resized=scale != 1)),
        images="\n".join(_images(left_name, right_name, crop, scale)),
        matcher=constructor(matcher, before="matcher = "),
    )


def _imports(matcher: StereoMatcher, *, resized: bool) -> list[str]:
    return [
        *(["import cv2"] if resized else []),
        "import numpy as np",
        "",
        "import stereolag as sl",
        "from stereolag.export import pfm",
        *imports(matcher),
    ]


def _images(left_name: str, right_name: str, crop: tuple[int, int] | None, scale: float) -> list[str]:
    lines = [
        f"left = sl.read_image(FOLDER / {_file(left_name)})",
        f"right = sl.read_image(FOLDER / {_file(right_name)})",
    ]
    if crop is not None:
        kept = f"[:{crop[0]}, :{crop[1]}]"
        lines.append(f"left, right = left{kept}, right{kept}")
    if scale != 1:
        size = f"fx={scale!r}, fy={scale!r}, interpolation=cv2.INTER_AREA"
        lines += [f"left = cv2.resize(left, None, {size})", f"right = cv2.resize(right, None, {size})"]
    return lines


def _file(name: str) -> str:
    """Return the name without folders, as a literal that cannot be anything but a text."""
    return text_literal(re.split(r"[/\\]", name)[-1])
