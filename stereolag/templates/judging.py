"""From scored positions to an answer: the matches, the rivals, and whether the matches are reliable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.templates.peaks import Indices, Scores, Shape, elsewhere, next_elsewhere, suppress
from stereolag.templates.result import TemplateMatch, TemplateSearch
from stereolag.templates.verdict import MOST_RIVALS, verdict


@dataclass(frozen=True)
class Places:
    """Scored positions of a template.

    Parameters
    ----------
    rows, cols, scores
        One for each position; no score is NaN.
    shape
        Height and width of the template, px; arrays if the template is resized or rotated.
    poses
        Scale and rotation at each position, None if the template is searched only as given.
    """

    rows: Indices
    cols: Indices
    scores: Scores
    shape: Shape
    poses: list[tuple[float, float]] | None = None

    def match(self, index: int) -> TemplateMatch:
        """Return one position as a match."""
        height, width = (int(side if isinstance(side, int) else side[index]) for side in self.shape)
        scale, rotation = (1.0, 0.0) if self.poses is None else self.poses[index]
        row, col, score = int(self.rows[index]), int(self.cols[index]), float(self.scores[index])
        return TemplateMatch(row, col, height, width, score, scale, rotation)

    def joined(self, rows: Indices, cols: Indices, scores: Scores) -> Places:
        """Return these positions followed by others."""
        joined: list[npt.NDArray[Any]] = [
            np.concatenate(pair) for pair in ((self.rows, rows), (self.cols, cols), (self.scores, scores))
        ]
        return Places(joined[0], joined[1], joined[2], self.shape)


def judged(
    places: Places,
    max_matches: int,
    min_score: float,
    *,
    score_map: npt.NDArray[np.float32] | None,
    candidates: int,
    matchable: int | None = None,
) -> TemplateSearch:
    """Return the result of a search.

    Parameters
    ----------
    places
        Every position that may be a match or a rival.
    max_matches, min_score
        As for :func:`~stereolag.templates.match_template`.
    score_map, candidates
        Passed on to the result, whose `elapsed_s` is left at 0.
    matchable
        Number of places, from the first on, that may be matches; all of them by default.
    """
    rows, cols, scores, shape = places.rows, places.cols, places.scores, places.shape
    enough = np.flatnonzero(scores[:matchable] >= min_score)
    height, width = (side if isinstance(side, int) else side[enough] for side in shape)
    kept = [
        int(enough[one]) for one in suppress(rows[enough], cols[enough], scores[enough], (height, width), max_matches)
    ]
    judgement = verdict([float(scores[one]) for one in kept], next_elsewhere(rows, cols, scores, shape, kept))
    best = int(np.argmax(scores)) if scores.size else None
    sure = kept[: judgement.clear] or ([] if best is None else [best])
    return TemplateSearch(
        matches=[places.match(one) for one in kept],
        score_map=score_map,
        candidates=candidates,
        elapsed_s=0.0,
        best=None if best is None else places.match(best),
        rivals=[places.match(one) for one in elsewhere(rows, cols, scores, shape, sure, MOST_RIVALS)],
        clear=judgement.clear,
        reason=judgement.reason,
    )
