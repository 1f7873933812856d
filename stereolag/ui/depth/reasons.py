"""The reasons for which a pixel has no measurement, in words."""

from __future__ import annotations

from stereolag.stereo.blank_reasons import blank_reasons
from stereolag.stereo.opencv import BlockMatcher
from stereolag.stereo.result import Reason, ReasonMap
from stereolag.ui.depth.judging import settings_of
from stereolag.ui.depth.view import DepthView
from stereolag.ui.results import computed

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
