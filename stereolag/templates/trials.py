"""Whether each method still finds a template at a known place."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from stereolag.core.inputs import Image
from stereolag.templates.opencv import opencv_search
from stereolag.templates.search import match_template

TrialMethod = Literal["fft", "sampled", "opencv"]
Outcome = Literal["right", "elsewhere", "missed", "refused"]

TOLERANCE: Final = 0.1
"""Tolerance of a template's place, as a share of its shorter side: interpolation moves the peak."""

LEAST_TOLERANCE_PX: Final = 2.0


@dataclass(frozen=True)
class Trial:
    """The outcome of one method.

    Attributes
    ----------
    method
        "fft" and "sampled" of :func:`~stereolag.templates.match_template`, or "opencv".
    outcome
        "right": found at its place; "elsewhere": found at another; "missed": no score reaches `min_score`;
        "refused": the method cannot search here.
    row, col
        Top-left pixel of the best place, None if no place has a score.
    score
        Score of that place, -1..1; NaN if there is none.
    elapsed_s
        Seconds the search took.
    refusal
        Why the method cannot search, as a sentence.
    """

    method: TrialMethod
    outcome: Outcome
    row: int | None
    col: int | None
    score: float
    elapsed_s: float
    refusal: str = ""


def try_methods(
    image: Image, template: Image, place: tuple[int, int], *, mask: Image | None = None, min_score: float = 0.5
) -> tuple[Trial, ...]:
    """Search with every method, and judge the best place of each against the known place.

    To count as found, its score only has to reach `min_score`: OpenCV has no other test.

    Parameters
    ----------
    image, template, mask, min_score
        As for :func:`~stereolag.templates.match_template`; `min_score` applies to OpenCV too.
    place
        (row, col) of the template's top-left pixel, the ground truth.
    """
    tolerance = max(LEAST_TOLERANCE_PX, TOLERANCE * min(template.shape[:2]))

    def judged(method: TrialMethod) -> Trial:
        try:
            row, col, score, elapsed_s = SEARCHES[method](image, template, mask, min_score)
        except ValueError as error:
            return Trial(method, "refused", None, None, math.nan, 0.0, str(error))
        if row is None or col is None or not score >= min_score:
            return Trial(method, "missed", row, col, score, elapsed_s)
        near = math.hypot(row - place[0], col - place[1]) <= tolerance
        return Trial(method, "right" if near else "elsewhere", row, col, score, elapsed_s)

    return tuple(judged(method) for method in SEARCHES)


Answer = tuple[int | None, int | None, float, float]
"""Row, column, score and seconds of the best place."""


def _fft(image: Image, template: Image, mask: Image | None, min_score: float) -> Answer:
    result = match_template(image, template, method="fft", mask=mask, min_score=min_score)
    scores = result.score_map
    if scores is None or np.isnan(scores).all():
        return None, None, math.nan, result.elapsed_s
    row, col = divmod(int(np.nanargmax(scores)), scores.shape[1])
    return row, col, float(scores[row, col]), result.elapsed_s


def _sampled(image: Image, template: Image, mask: Image | None, min_score: float) -> Answer:
    result = match_template(image, template, method="sampled", mask=mask, min_score=min_score, seed=0)
    if not result.matches:
        return None, None, math.nan, result.elapsed_s
    best = result.matches[0]
    return best.row, best.col, best.score, result.elapsed_s


def _opencv(image: Image, template: Image, mask: Image | None, min_score: float) -> Answer:
    result = opencv_search(image, template, mask=mask)
    if result.row < 0:
        return None, None, math.nan, result.elapsed_s
    return result.row, result.col, result.score, result.elapsed_s


SEARCHES: Final[dict[TrialMethod, Callable[[Image, Image, Image | None, float], Answer]]] = {
    "fft": _fft,
    "sampled": _sampled,
    "opencv": _opencv,
}
