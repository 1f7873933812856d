"""Why is it blank? The pixels without a measurement, by reason."""

from __future__ import annotations

import streamlit as st

from stereolag.arrays import ReasonMap
from stereolag.explaining.blank_reasons import blank_reasons
from stereolag.figures.linked_pictures import Picture, Reading, hexadecimal, word_legend
from stereolag.figures.reasons import REASON_COLOURS, reasons_picture, share_of_reasons
from stereolag.stereo.opencv import BlockMatcher
from stereolag.stereo.reasons import Reason
from stereolag.ui.depth.view import DepthView, settings_of
from stereolag.ui.linked_pictures import linked_pictures
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed

KEY = "depth.blanks"


@fragment
def show_blanks(view: DepthView) -> None:
    """Show where each method has no measurement and why, and how much of the picture each reason costs."""
    reasons = {name: reasons_of(view, name) for name in view.results}
    present = [cause for cause in REASON_COLOURS if any((one == cause).any() for one in reasons.values())]
    words = tuple(REASON_WORDS[cause] for cause in Reason)
    linked_pictures(
        [
            Picture(name, reasons_picture(reason, view.pair.left), (Reading(reason, words=words),))
            for name, reason in reasons.items()
        ],
        key=KEY,
        columns=min(3, len(reasons)),
        legends=[
            word_legend(
                "",
                [hexadecimal(REASON_COLOURS[cause]) for cause in present],
                [REASON_WORDS[cause] for cause in present],
            )
        ],
    )
    st.plotly_chart(share_of_reasons(reasons, REASON_WORDS), key=f"{KEY}.shares", config={"displayModeBar": False})
    st.markdown("\n".join(f"- **{REASON_WORDS[cause].capitalize()}**: {REASONS_EXPLAINED[cause]}" for cause in present))
    st.caption(
        "StereoBM and StereoSGBM do not say why. Their reasons were found by matching again with one filter after "
        "another switched off: the filter whose absence brings a pixel back had blanked it."
    )


REASON_WORDS = {
    Reason.MEASURED: "measured",
    Reason.FILLED: "filled in",
    Reason.OUT_OF_FRAME: "out of frame",
    Reason.LOW_TEXTURE: "too little texture",
    Reason.AMBIGUOUS: "ambiguous",
    Reason.LEFT_RIGHT: "left and right disagree",
    Reason.SPECKLE: "speckle",
    Reason.AT_SEARCH_EDGE: "at the edge of the search",
}

REASONS_EXPLAINED = {
    Reason.FILLED: "Not measured: the surface behind was continued.",
    Reason.OUT_OF_FRAME: "The window, or the place where it should be found, lies outside the right image.",
    Reason.LOW_TEXTURE: "The window is as good as blank, like a bare wall: nothing to compare.",
    Reason.AMBIGUOUS: "Another place fits nearly as well: a fence, a repeated pattern, or something too smooth.",
    Reason.LEFT_RIGHT: "Matched from the right image the answer is another: mostly hidden behind something nearer.",
    Reason.SPECKLE: "A small island of disparities unlike all around it: mostly a chance match.",
    Reason.AT_SEARCH_EDGE: "The best match lies on the edge of the search area: the true one may lie beyond.",
}


def reasons_of(view: DepthView, name: str) -> ReasonMap:
    """Return the reasons of one of the maps, for OpenCV's found by matching again."""
    result = view.results[name]
    if not isinstance(result.settings, BlockMatcher):
        return result.reason
    explained = computed(
        lambda progress: _Reasons(blank_reasons(result, view.pair.left, view.pair.right, progress=progress)),
        inputs=view.pair.digest,
        settings=settings_of(result),
        shared=view.pair.shared,
        label=f"Asking {name} why …",
    )
    return explained.reason


class _Reasons:
    """Reasons as the store of results keeps them: an attribute whose bytes it can count."""

    def __init__(self, reason: ReasonMap) -> None:
        self.reason = reason
