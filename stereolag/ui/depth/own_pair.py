"""The visitor's own pair: two images, one side-by-side image or an archive, with ground truth and calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import streamlit as st

from stereolag.assess.disparities import DIVISORS, likely_divisor
from stereolag.core.inputs import Image
from stereolag.io.archives import is_archive
from stereolag.io.disparities import StoredDisparity, read_stored_disparity
from stereolag.io.guard import guarded
from stereolag.io.images import read_image
from stereolag.pair import Pair
from stereolag.ui.choices import image_limits, show_limits
from stereolag.ui.depth.assembling import SAME_PICTURE, Pictures, Truth, split_picture, together
from stereolag.ui.depth.calibrating import ask_calibration
from stereolag.ui.depth.handed_over import handed_over
from stereolag.ui.depth.several import Bundle, ask_bundle, forget_bundle, pair_of_bundle, read_bundle
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed
from stereolag.ui.states import show_refused
from stereolag.ui.uploads import DISPARITY_TYPES, PICTURE_TYPES, Upload, forget_together, put_together, upload

ARRANGEMENTS = {"files": "Left and right files", "beside": "One side-by-side image", "several": "ZIP or several pairs"}


def ask_own_pair(key: str) -> Pair | None:
    """Ask for images, truth and calibration; return the last pair that fitted together, or None until there is one.

    An archive in place of the left image contains all of these: a saved session, or several pairs.
    """
    handed = handed_over()
    if handed is not None:
        return handed
    arrangement = st.segmented_control(
        "Images",
        [*ARRANGEMENTS],
        default="files",
        format_func=lambda name: ARRANGEMENTS[name],
        required=True,
        **persistent(f"{key}.arrangement"),
        label_visibility="collapsed",
    )
    if arrangement == "several":
        bundle = ask_bundle(key)
        show_limits(image_limits())
        return pair_of_bundle(bundle)
    columns = st.columns([2, 1], gap="medium")
    with columns[0]:
        found = _ask_one_picture(key) if arrangement == "beside" else _ask_two_pictures(key)
    if isinstance(found, Upload):
        return pair_of_bundle(found)
    forget_bundle()
    pictures = found
    with columns[1]:
        truth = _ask_truth(key, pictures)
    show_limits(image_limits())
    calibration = ask_calibration(key)
    if pictures is None:
        forget_together(f"{key}.own.{arrangement}")
        return None
    return put_together(lambda: together(pictures, truth, calibration), f"{key}.own.{arrangement}")


def _ask_two_pictures(key: str) -> Pictures | Upload[Bundle] | None:
    columns = st.columns(2, gap="medium")
    with columns[0]:
        left = upload(
            "Left image",
            _picture_or_bundle,
            key=f"{key}.left",
            types=(*PICTURE_TYPES, "zip"),
            note="Or a ZIP: one saved from this page, or several pairs.",
        )
    if left is not None and not isinstance(left.content, np.ndarray):
        return Upload(left.digest, left.content)
    with columns[1]:
        right = upload("Right image", guarded(read_image), key=f"{key}.right", types=PICTURE_TYPES)
    if left is None or right is None:
        return None
    assert isinstance(left.content, np.ndarray)
    changes = (SAME_PICTURE,) if left.digest == right.digest else ()
    return Pictures(left.content, right.content, f"{left.digest} {right.digest}", changes)


def _picture_or_bundle(data: bytes) -> Image | Bundle:
    return read_bundle([("", data)]) if is_archive(data) else guarded(read_image)(data)


def _ask_one_picture(key: str) -> Pictures | None:
    both = upload(
        "Both images side by side",
        split_picture,
        key=f"{key}.beside",
        types=PICTURE_TYPES,
        note="The left image in the left half, as stereo cameras deliver them.",
    )
    return None if both is None else replace(both.content, digest=both.digest)


def _ask_truth(key: str, pictures: Pictures | None) -> Truth | None:
    """Ask for the ground truth of the left image; the default divisor of 8-bit values is the one that fits the pair."""
    given = upload(
        "Ground truth (optional)",
        guarded(read_stored_disparity),
        key=f"{key}.truth",
        types=DISPARITY_TYPES,
        note="PFM, NPY, or PNG of 16 bits (px × 256, as KITTI’s) or of 8 bits, whose divisor is found from the pair.",
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
        **persistent(f"{key}.divisor"),
        placeholder="as chosen" if unsure else "as the file says",
        help="Stored value ÷ divisor = px.",
    )
    if given is None or pictures is None:
        return None
    divisor = divisor or given.content.divisor or 1.0
    try:
        return Truth(given.content.divided(divisor), f"{given.digest} {divisor:g}")
    except ValueError as error:
        show_refused(error)
        return None


def _ask_divisor(truth: Upload[StoredDisparity], pictures: Pictures, key: str) -> float:
    """Ask for the divisor of 8-bit values; the default is the one that agrees best with a quick map of the pair."""
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
            **persistent(f"{key}.divisor.{truth.digest[:16]}.{pictures.digest[:16]}"),
            help="The preselected one agrees best with a quick map of the pair.",
        )
    )
