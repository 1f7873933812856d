"""OpenCV's result for the same template search, beside ours."""

from __future__ import annotations

from typing import Final

import numpy as np
import streamlit as st

from stereolag.templates import TemplateSearch
from stereolag.templates.opencv import OpenCVSearch, estimate_opencv, is_masked, opencv_search
from stereolag.ui import prose
from stereolag.ui.navigation import fragment
from stereolag.ui.pictures import PictureAndTemplate
from stereolag.ui.results import computed_before, computed_in_turn
from stereolag.ui.searches import TEMPLATE_METHODS
from stereolag.ui.sentences import duration
from stereolag.ui.states import show_refused

TASK: Final = "template search by OpenCV"

SAME_SCORE: Final = 1e-4
"""Scores of the two implementations that differ by less are equal up to rounding."""


@fragment
def show_opencv_beside(inputs: PictureAndTemplate, result: TemplateSearch, method: str) -> None:
    """Offer to search with OpenCV too, and show place, score and time of both.

    Parameters
    ----------
    inputs
        The image and the template.
    result, method
        Our result and its method.
    """
    known = computed_before(TASK, inputs=inputs.digest, settings="", shared=inputs.shared)
    asked = st.session_state.get("template.opencv.asked") == inputs.digest
    masked = is_masked(inputs.template, inputs.mask)
    prose.markdown("### Beside OpenCV")
    if known is None and not asked:
        st.button(
            "Search with OpenCV too",
            key="template.opencv",
            help="cv2.matchTemplate with TM_CCOEFF_NORMED, on the whole image"
            + (" and with the same mask." if masked else "."),
            on_click=_ask,
            args=(inputs.digest,),
        )
        return
    try:
        theirs = computed_in_turn(
            TASK,
            lambda _: opencv_search(inputs.picture, inputs.template, mask=inputs.mask),
            estimate_opencv(inputs.picture.shape, masked),
            inputs=inputs.digest,
            settings="",
            shared=inputs.shared,
            label="Searching with OpenCV …",
        )
    except ValueError as error:
        show_refused(error)
        return
    if theirs is None:
        return
    prose.markdown(table(result, theirs, method, masked))
    for sentence in differences(result, theirs, method):
        prose.caption(sentence)


def _ask(digest: str) -> None:
    st.session_state["template.opencv.asked"] = digest


def table(ours: TemplateSearch, theirs: OpenCVSearch, method: str, masked: bool) -> str:
    """Return both results as a Markdown table."""
    if ours.found:
        best = ours.matches[0]
        answer = f"row {best.row}, column {best.col} | {best.score:.4f}"
    else:
        answer = "not found | –"
    other = f"row {theirs.row}, column {theirs.col} | {theirs.score:.4f}" if theirs.row >= 0 else "none | –"
    name = "OpenCV `matchTemplate`" + (", masked" if masked else "")
    return "\n".join(
        (
            "| | Best place | Score | Took |",
            "|---|---|--:|--:|",
            f"| {TEMPLATE_METHODS[method]} | {answer} | {duration(ours.elapsed_s)} |",
            f"| {name} | {other} | {duration(theirs.elapsed_s)} |",
        )
    )


def differences(ours: TemplateSearch, theirs: OpenCVSearch, method: str) -> list[str]:
    """Return one sentence for each difference and its cause, or that the results agree."""
    said = []
    if theirs.undefined:
        said.append(
            f"In {theirs.undefined:,} places nothing varies under the template: 0/0. OpenCV’s score there is NaN or "
            "infinite, and `cv2.minMaxLoc` then names no place at all; they are skipped here."
        )
    if theirs.row >= 0:
        said.append(_about_places(ours, theirs, method))
    return said


def _about_places(ours: TemplateSearch, theirs: OpenCVSearch, method: str) -> str:
    if not ours.found:
        also = " Sampled looks for exact pixels; OpenCV compares patterns, as FFT does." if method == "sampled" else ""
        return f"OpenCV always names a place; it does not say whether the template is there.{also}"
    best = ours.matches[0]
    apart = abs(best.score - theirs.score)
    if (best.row, best.col) == (theirs.row, theirs.col):
        if apart <= SAME_SCORE:
            return f"The same place; the scores differ by less than {SAME_SCORE:.4f}."
        return f"The same place; the scores differ by {apart:.2g}: OpenCV sums in single precision."
    if ours.score_map is None:
        if method == "sampled":
            return "Sampled scores a few places only, and stops at the first that are good enough."
        return "Ours looked for other sizes and angles too, which OpenCV does not try."
    here = float(ours.score_map[theirs.row, theirs.col])
    if np.isnan(here):
        return (
            f"At OpenCV’s place the image is flat: there is nothing to correlate, and its score of {theirs.score:.3f} "
            "is a rounding error divided by another. Ours gives such places no score."
        )
    if abs(here - best.score) <= SAME_SCORE:
        return "Both places score the same: there are several copies."
    return f"Ours scores {here:.3f} at OpenCV’s place: OpenCV sums in single precision, too coarse for these values."
