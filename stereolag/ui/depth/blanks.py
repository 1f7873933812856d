"""Why is it blank? The pixels without a measurement, by reason."""

from __future__ import annotations

from functools import partial

import streamlit as st

from stereolag.assess.explaining import blank_reasons
from stereolag.core.arrays import ReasonMap
from stereolag.figures.legends import hexadecimal, word_legend
from stereolag.figures.linked_pictures import Picture, Reading
from stereolag.figures.reasons import REASON_COLOURS, reasons_picture, share_of_reasons
from stereolag.stereo.reasons import Reason
from stereolag.ui import prose
from stereolag.ui.depth.alternatives import all_blanks_in_words, blanks_in_words
from stereolag.ui.depth.maps import settings_key
from stereolag.ui.depth.view import DepthView
from stereolag.ui.linked_pictures import linked_pictures
from stereolag.ui.navigation import fragment
from stereolag.ui.results import computed
from stereolag.ui.sentences import OPENCV_REASONS, REASON_WORDS, REASONS_EXPLAINED

KEY = "depth.blanks"


@fragment
def show_blanks(view: DepthView) -> None:
    """Show where each method has no measurement and why, and the share of the image lost to each reason."""
    reasons = {name: reasons_of(view, name) for name in view.results}
    present = [cause for cause in REASON_COLOURS if any((one == cause).any() for one in reasons.values())]
    words = tuple(REASON_WORDS[cause] for cause in Reason)
    linked_pictures(
        [
            Picture(
                name,
                reasons_picture(reason, view.pair.left),
                (Reading(reason, words=words),),
                alternative=partial(blanks_in_words, reason),
            )
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
    st.plotly_chart(
        share_of_reasons(reasons, REASON_WORDS),
        key=f"{KEY}.shares",
        config={"displayModeBar": False},
        alt=all_blanks_in_words(reasons),
    )
    prose.markdown(
        "\n".join(f"- **{REASON_WORDS[cause].capitalize()}**: {REASONS_EXPLAINED[cause]}" for cause in present)
    )
    if not all(result.settings.gives_reasons for result in view.results.values()):
        prose.caption(OPENCV_REASONS)


def reasons_of(view: DepthView, name: str) -> ReasonMap:
    """Return the reason for every pixel of one map; OpenCV's reasons are found by matching again."""
    result = view.results[name]
    if result.settings.gives_reasons:
        return result.reason
    return computed(
        "reasons",
        lambda progress: blank_reasons(result, view.pair.left, view.pair.right, progress=progress),
        inputs=view.pair.digest,
        settings=settings_key(result),
        shared=view.pair.shared,
        label=f"Finding the reasons of {name} …",
    )
