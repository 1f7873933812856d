"""A pair of the visitor's own: two images or one with both, and what is known of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import streamlit as st

from stereolag.arrays import FloatMap
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scaling import calibration_for, cropped_alike, halves
from stereolag.inputs import Image, as_stereo_pair
from stereolag.reading import read_disparity, read_image
from stereolag.ui.depth.calibrating import Calibrated, ask_calibration
from stereolag.ui.pairs import Change, StereoPair
from stereolag.ui.uploads import DISPARITY_TYPES, PICTURE_TYPES, Upload, forget_together, put_together, upload

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
        truth = _ask_truth(key)
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


def _ask_truth(key: str) -> Upload[FloatMap] | None:
    """Ask for the ground truth of the left image."""
    divisor = st.session_state.get(f"{key}.divisor")
    truth = upload(
        "Ground truth (optional)",
        lambda data: read_disparity(data, divisor=divisor),
        key=f"{key}.truth",
        types=DISPARITY_TYPES,
        note="PFM, NPY, or PNG of 16 bits (px × 256, as KITTI’s) or of 8 bits with a divisor.",
        variant=str(divisor),
    )
    st.number_input(
        "Divisor of the ground truth",
        min_value=0.001,
        value=None,
        key=f"{key}.divisor",
        persist_state="session",
        placeholder="as the file says",
        help="Stored value ÷ divisor = px. Only files of 8 bits need it, often 4 or 16.",
    )
    return truth


def _together(pictures: Pictures, truth: Upload[FloatMap] | None, calibration: Calibrated | None) -> StereoPair:
    """Return the pair; ValueError where the files do not belong together."""
    left, right = as_stereo_pair(*cropped_alike(pictures.left, pictures.right))
    rows, cols = left.shape[:2]
    changes = list(pictures.changes)
    if pictures.left.shape[:2] != pictures.right.shape[:2]:
        changes.append(Change("", f"The images differ by a few pixels and were cropped to {cols} × {rows}."))
    disparity = None if truth is None else _fitting_truth(truth.content, pictures.left)[:rows, :cols]
    fitted = None if calibration is None else calibration_for(calibration.content, cols, rows)
    if calibration is not None and fitted is not calibration.content:
        changes.append(Change("", f"The calibration was scaled to {cols} × {rows} pixels."))
    return StereoPair(
        left,
        right,
        disparity,
        _disparities_of(fitted),
        "Your own pair.",
        " ".join((pictures.digest, truth.digest if truth else "")),
        False,
        fitted,
        changes=tuple(changes),
        pictures=pictures.digest,
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
