"""The pictures of a depth view, as its parts show them: one range of colours, the same words under each."""

from __future__ import annotations

from stereolag.figures.colours import NO_ANSWER, coloured
from stereolag.figures.linked_pictures import Legend, Picture, Reading, hexadecimal, strip_legend, word_legend
from stereolag.figures.pictures import as_rgb
from stereolag.stereo.result import Reason, ReasonMap
from stereolag.ui.depth.metric import depth_scale, disparity_error
from stereolag.ui.depth.reasons import REASON_WORDS
from stereolag.ui.depth.view import DepthView

LEFT, TRUTH = "Left image", "Truth"


def left_picture(view: DepthView) -> Picture:
    """Return the left image."""
    return Picture(LEFT, as_rgb(view.pair.left), photograph=True)


def map_picture(view: DepthView, name: str, reason: ReasonMap | None = None) -> Picture:
    """Return the map of a method; under it disparity, depth, score, and the reason where there is none."""
    result = view.results[name]
    words = [_said(cause) for cause in Reason]
    return Picture(
        name,
        coloured(result.disparity, view.low, view.high, view.palette),
        (
            Reading(result.disparity, unit="px", digits=2, depth=depth_scale(view.pair, disparity_error(view, name))),
            Reading(result.reason if reason is None else reason, words=tuple(words)),
            Reading(result.score, label="score", digits=2),
        ),
    )


def truth_picture(view: DepthView) -> list[Picture]:
    """Return the true disparity, or nothing where it is not known."""
    truth = view.pair.truth
    if truth is None:
        return []
    reading = Reading(truth, unit="px", digits=2, depth=depth_scale(view.pair, 0.0))
    return [Picture(TRUTH, coloured(truth, view.low, view.high, view.palette), (reading,))]


def map_legends(view: DepthView) -> tuple[Legend, ...]:
    """Return what the colours of the maps mean."""
    return (
        strip_legend("disparity, px, far to near", view.low, view.high, view.palette),
        word_legend("", [hexadecimal(NO_ANSWER)], ["no answer"]),
    )


def _said(reason: Reason) -> str:
    """Return a reason as it stands under a map; nothing for what was simply measured."""
    if reason is Reason.MEASURED:
        return ""
    return REASON_WORDS[reason] if reason is Reason.FILLED else f"no answer: {REASON_WORDS[reason]}"
