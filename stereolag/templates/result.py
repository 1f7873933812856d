"""The matches and the result of a template search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stereolag.templates.verdict import Reason, leads


@dataclass(frozen=True)
class TemplateMatch:
    """One position of the template in the image.

    Parameters
    ----------
    row, col
        Top-left pixel, px; for a rotated template, of the upright box around it.
    height, width
        Size of the template there, px; for a rotated template, of that box.
    score
        Pearson's correlation coefficient, -1..1: 1 for an exact copy, whatever its brightness and contrast.
    scale
        Size in the image over size of the template.
    rotation
        Rotation of the template in the image, degrees, positive counter-clockwise as seen.

    Examples
    --------
    >>> import numpy as np
    >>> import stereolag as sl
    >>> image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
    >>> match = sl.match_template(image, image[40:60, 70:100]).matches[0]
    >>> match.row, match.col, match.height, match.width  # px
    (40, 70, 20, 30)
    >>> round(match.score, 3)
    1.0
    """

    row: int
    col: int
    height: int
    width: int
    score: float
    scale: float = 1.0
    rotation: float = 0.0


@dataclass(frozen=True)
class TemplateSearch:
    """The result of :func:`match_template`.

    Parameters
    ----------
    matches
        Places that score high enough, best first, never overlapping by more than half of their area; empty if no score
        is high enough. Only the first `clear` of them are reliable.
    score_map
        (rows - height + 1, cols - width + 1) float32: the score with the template's top-left pixel at each
        (row, col), NaN where the window is flat. None for "sampled", and if sizes or angles were searched.
    candidates
        Number of positions scored.
    elapsed_s
        Seconds the search took.
    best
        The place with the highest score, high enough or not; None if nothing could be scored.
    rivals
        The best places other than the clear matches (other than the best place if no match is clear), best first; they
        share no pixel with those or with one another.
    clear
        Number of matches, best first, that fit clearly better than every other place.
    reason
        Reason for `found`: "clear"; "look_alikes" if others fit about as well; "low_score" if no place scores high
        enough; "other_colours" or "mirrored" if the best place fits clearly better with the template's colour channels
        in another order, or with its mirror image.

    Examples
    --------
    A template that occurs twice is found only if two are wanted:

    >>> import numpy as np
    >>> import stereolag as sl
    >>> image = np.random.default_rng(0).integers(0, 256, (120, 160), dtype=np.uint8)
    >>> image[80:100, 10:40] = image[40:60, 70:100]
    >>> one = sl.match_template(image, image[40:60, 70:100])
    >>> one.found, one.reason
    (False, 'look_alikes')
    >>> two = sl.match_template(image, image[40:60, 70:100], max_matches=2)
    >>> two.found, sorted((match.row, match.col) for match in two.matches)  # px
    (True, [(40, 70), (80, 10)])
    """

    matches: list[TemplateMatch]
    score_map: npt.NDArray[np.float32] | None
    candidates: int
    elapsed_s: float
    best: TemplateMatch | None
    rivals: list[TemplateMatch]
    clear: int
    reason: Reason

    @property
    def found(self) -> bool:
        """Whether the template is in the image: at least one place scores high enough and has a clear lead."""
        return self.clear > 0

    @property
    def look_alikes(self) -> list[TemplateMatch]:
        """The best place and the rivals without a clear gap to it, best first; empty for any other reason."""
        best = self.best
        if best is None or self.reason != "look_alikes":
            return []
        return [best, *(rival for rival in self.rivals if not leads(best.score, rival.score))]
