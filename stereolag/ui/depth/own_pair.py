"""A pair of the visitor's own: two images or one with both, and what is known of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import streamlit as st

from stereolag.arrays import FloatMap
from stereolag.doctor.truth_scale import DIVISORS, likely_divisor
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scaling import as_deep, calibration_for, cropped_alike, halves
from stereolag.inputs import Image, as_stereo_pair
from stereolag.reading import read_image
from stereolag.reading.disparities import StoredDisparity, read_stored_disparity
from stereolag.ui.depth.calibrating import Calibrated, ask_calibration
from stereolag.ui.pairs import Change, StereoPair
from stereolag.ui.results import computed
from stereolag.ui.uploads import DISPARITY_TYPES, PICTURE_TYPES, Upload, forget_together, put_together, upload

ONE_DEPTH = (
    "One image has 8 bits per channel and the other 16: both were brought to 16, black at 0 and white at 65535, by how "
    "bright they are on the whole."
)
SAME_PICTURE = "Left and right are one and the same image: every disparity is 0, and there is no depth to see."

ARRANGEMENTS = {"files": "Left and right files", "beside": "One side-by-side image"}


@dataclass(frozen=True, eq=False)
class Pictures:
    """Two images as they were given, a digest of their files, and what was done to them."""

    left: Image
    right: Image
    digest: str
    changes: tuple[Change, ...] = ()


def ask_own_pair(key: str) -> StereoPair | None:
    """Ask for images, truth and calibration; return the last that fitted together, or None while there are none."""
    arrangement = st.segmented_control(
        "Images",
        [*ARRANGEMENTS],
        default="files",
        format_func=lambda name: ARRANGEMENTS[name],
        required=True,
        key=f"{key}.arrangement",
        persist_state="session",
        label_visibility="collapsed",
    )
    columns = st.columns([2, 1], gap="medium")
    with columns[0]:
        pictures = _ask_one_picture(key) if arrangement == "beside" else _ask_two_pictures(key)
    with columns[1]:
        truth = _ask_truth(key, pictures)
    calibration = ask_calibration(key)
    if pictures is None:
        forget_together(f"{key}.own.{arrangement}")
        return None
    return put_together(lambda: _together(pictures, truth, calibration), f"{key}.own.{arrangement}")


def _ask_two_pictures(key: str) -> Pictures | None:
    columns = st.columns(2, gap="medium")
    with columns[0]:
        left = upload("Left image", read_image, key=f"{key}.left", types=PICTURE_TYPES)
    with columns[1]:
        right = upload("Right image", read_image, key=f"{key}.right", types=PICTURE_TYPES)
    if left is None or right is None:
        return None
    changes = (Change("", SAME_PICTURE),) if left.digest == right.digest else ()
    return Pictures(left.content, right.content, f"{left.digest} {right.digest}", changes)


def _ask_one_picture(key: str) -> Pictures | None:
    both = upload(
        "Both images side by side",
        _split,
        key=f"{key}.beside",
        types=PICTURE_TYPES,
        note="The left image in the left half, as stereo cameras deliver them.",
    )
    return None if both is None else replace(both.content, digest=both.digest)


def _split(data: bytes) -> Pictures:
    """Return both halves of a side-by-side image, without a digest; ValueError where it cannot be read or halved."""
    both = read_image(data)
    left, right = halves(both)
    width = both.shape[1]
    odd = f" Its width of {width} px is odd: the middle column is left out." if width % 2 else ""
    return Pictures(left, right, "", (Change("", f"The image was split down the middle.{odd}"),))


@dataclass(frozen=True, eq=False)
class Truth:
    """A ground truth, px, and a digest of its file and of what was made of its numbers."""

    disparity: FloatMap
    digest: str


def _ask_truth(key: str, pictures: Pictures | None) -> Truth | None:
    """Ask for the ground truth of the left image; one of 8 bits is read by the divisor that agrees with the pair."""
    given = upload(
        "Ground truth (optional)",
        read_stored_disparity,
        key=f"{key}.truth",
        types=DISPARITY_TYPES,
        note="PFM, NPY, or PNG of 16 bits (px × 256, as KITTI’s) or of 8 bits, whose divisor is told from the pair.",
    )
    divisor = st.session_state.get(f"{key}.divisor")
    unsure = given is not None and given.content.divisor is None and pictures is not None and divisor is None
    if unsure:
        assert given is not None
        assert pictures is not None
        divisor = _ask_divisor(given, pictures, key)
    st.number_input(
        "Another divisor" if unsure else "Divisor of the ground truth",
        min_value=0.001,
        value=None,
        key=f"{key}.divisor",
        persist_state="session",
        placeholder="as chosen" if unsure else "as the file says",
        help="Stored value ÷ divisor = px.",
    )
    if given is None or pictures is None:
        return None
    divisor = divisor or given.content.divisor or 1.0
    try:
        return Truth(given.content.divided(divisor), f"{given.digest} {divisor:g}")
    except ValueError as error:
        st.error(str(error))
        return None


def _ask_divisor(truth: Upload[StoredDisparity], pictures: Pictures, key: str) -> float:
    """Ask for the divisor of 8-bit values, beginning with the one that agrees best with a quick map of the pair."""
    stored = truth.content
    likely = computed(
        "divisor",
        lambda progress: np.array(likely_divisor(stored.divided(1.0), pictures.left, pictures.right)),
        inputs=f"{pictures.digest} {truth.digest}",
        settings="",
        shared=False,
        label="Comparing the ground truth with the pair …",
    )
    largest = int(stored.stored.max())
    return float(
        st.segmented_control(
            "8 bits per pixel: stored value ÷ divisor = px",
            DIVISORS,
            default=int(likely),
            format_func=lambda divisor: f"÷ {divisor}: up to {largest / divisor:.4g} px",
            required=True,
            key=f"{key}.divisor.{truth.digest[:16]}.{pictures.digest[:16]}",
            persist_state="session",
            help="The one chosen at first agrees best with a quick map of the pair.",
        )
    )


def _together(pictures: Pictures, truth: Truth | None, calibration: Calibrated | None) -> StereoPair:
    """Return the pair; ValueError where the files do not belong together."""
    left, right = as_stereo_pair(*as_deep(*cropped_alike(pictures.left, pictures.right)))
    rows, cols = left.shape[:2]
    changes = list(pictures.changes)
    if pictures.left.dtype != pictures.right.dtype:
        changes.append(Change("", ONE_DEPTH))
    if pictures.left.shape[:2] != pictures.right.shape[:2]:
        changes.append(Change("", f"The images differ by a few pixels and were cropped to {cols} × {rows}."))
    disparity = None if truth is None else _fitting_truth(truth.disparity, pictures.left)[:rows, :cols]
    fitted = None if calibration is None else calibration_for(calibration.content, cols, rows)
    if calibration is not None and fitted is not calibration.content:
        changes.append(Change("", f"The calibration was scaled to {cols} × {rows} pixels."))
    return StereoPair(
        left,
        right,
        disparity,
        _disparities_of(fitted),
        "Your own pair.",
        " ".join((pictures.digest, truth.digest if truth else "", _digest_of(calibration))),
        False,
        fitted,
        changes=tuple(changes),
    )


def _fitting_truth(truth: FloatMap, left: Image) -> FloatMap:
    if truth.shape != left.shape[:2]:
        (height, width), (rows, cols) = truth.shape, left.shape[:2]
        raise ValueError(
            f"The ground truth is {width} × {height} and the left image is {cols} × {rows} pixels; "
            "they must have the same size."
        )
    return truth


def _disparities_of(calibration: Calibration | None) -> int | None:
    return None if calibration is None else calibration.num_disparities


def _digest_of(calibration: Calibrated | None) -> str:
    """Return what of a calibration changes the images that are matched: the cameras before rectification."""
    return calibration.digest if calibration is not None and calibration.content.rig is not None else ""
