"""Why this match? Everything the correlation saw for one pixel."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
import numpy.typing as npt

from stereolag.inputs import as_grey, as_stereo_pair
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.matches import Score, WindowQuery
from stereolag.stereo.windows.peak_fits import peak_offset
from stereolag.stereo.windows.window_fft import score_surface

Surface = npt.NDArray[np.float64]


class Finding(Enum):
    """What kind of match a window has."""

    CLEAR = auto()
    REPEATS = auto()
    SMOOTH = auto()
    BARE = auto()
    UNLIKE = auto()
    AT_EDGE = auto()
    NOTHING = auto()


@dataclass(frozen=True)
class Box:
    """A rectangle of a picture: top-left pixel and size, px."""

    row: int
    col: int
    height: int
    width: int


@dataclass(frozen=True, eq=False)
class Inspection:
    """What one window saw.

    Attributes
    ----------
    window
        The window in the left picture.
    search
        The part of the right picture that was searched, cut to the frame.
    found
        The window's place in the right picture; None where nothing could be scored.
    surface
        (n_dy, n_dx) float64 scores; NaN = no candidate.
    dy, dx
        The displacements of its rows and columns, right minus left, px.
    peak, runner_up
        (dy, dx) of the best score and of the best one farther than 1 px from it; None where there is none.
    peak_score, runner_up_score
        Their scores; NaN where there is none.
    offset
        Sub-pixel offset of the peak along its row, px.
    contrast
        Standard deviation of the grey levels in the window, as a share of that of the whole picture.
    score
        How the windows were compared.
    """

    window: Box
    search: Box
    found: Box | None
    surface: Surface
    dy: npt.NDArray[np.intp]
    dx: npt.NDArray[np.intp]
    peak: tuple[int, int] | None
    runner_up: tuple[int, int] | None
    peak_score: float
    runner_up_score: float
    offset: float
    contrast: float
    score: Score

    @property
    def row(self) -> Surface:
        """Return the (n_dx,) scores along the row of the peak; of dy nearest 0 where there is no peak."""
        dy = self.peak[0] if self.peak else int(self.dy[np.argmin(np.abs(self.dy))])
        scores: Surface = self.surface[dy - int(self.dy[0])]
        return scores

    @property
    def disparity(self) -> float:
        """Return the disparity of the peak with its sub-pixel offset, px; NaN where there is no peak."""
        return -(self.peak[1] + self.offset) if self.peak else float("nan")

    def fit(self, offsets: npt.ArrayLike) -> Surface:
        """Return the curve through the peak and its two neighbours along the row, whose top is the sub-pixel peak.

        Parameters
        ----------
        offsets
            (n,) px from the peak in dx, where the curve is wanted.

        Returns
        -------
        ndarray
            (n,) float64 scores on the Gaussian (a parabola where a score is not positive) that
            :func:`stereolag.stereo.windows.peak_fits.peak_offset` takes its offset from; NaN where a neighbour is
            missing.
        """
        at = np.asarray(offsets, dtype=np.float64)
        peak = self.peak[1] - int(self.dx[0]) if self.peak else 0
        if self.peak is None or not 0 < peak < self.row.size - 1:
            return np.full(at.shape, np.nan)
        around = self.row[peak - 1 : peak + 2]
        gaussian = bool((around > 0).all())
        low, top, high = np.log(around) if gaussian else around
        curve = top + (high - low) / 2 * at + (low - 2 * top + high) / 2 * at**2
        return np.asarray(np.exp(curve) if gaussian else curve)

    @property
    def finding(self) -> Finding:
        """Return what kind of match the surface shows."""
        if self.peak is None:
            return Finding.NOTHING
        if self._at_edge:
            return Finding.AT_EDGE
        if self.score == "zncc" and self.peak_score < POOR_SCORE:
            return Finding.BARE if self.contrast < BARE_CONTRAST else Finding.UNLIKE
        if self.peak_score - self.runner_up_score < AMBIGUOUS_MARGIN * abs(self.peak_score):
            return Finding.REPEATS if self._valley_between else Finding.SMOOTH
        return Finding.CLEAR

    @property
    def verdict(self) -> str:
        """Return in a sentence what the surface says of the match."""
        scores = f"{self.peak_score:.3f} and {self.runner_up_score:.3f}"
        return {
            Finding.NOTHING: "Nothing to correlate: the window is flat, like a bare wall, or every place it could "
            "match lies outside the picture.",
            Finding.AT_EDGE: "The best score lies on the edge of the search area: the true match may be outside it.",
            Finding.BARE: f"A bare wall: the window holds {self.contrast:.0%} of the picture’s contrast, and the best "
            f"place scores {self.peak_score:.2f}. What is compared is mostly noise.",
            Finding.UNLIKE: f"Nothing looks like this: the best place scores {self.peak_score:.2f}. Perhaps the "
            "other camera cannot see it, or sees it in another light.",
            Finding.REPEATS: f"Two places fit almost equally well ({scores}), with worse ones between them: the "
            "pattern repeats, like a fence, and chance decides.",
            Finding.SMOOTH: f"Two places fit almost equally well ({scores}), and so do those between them: the window "
            "is too smooth to tell neighbours apart, and noise decides.",
            Finding.CLEAR: f"One clear peak: {self.peak_score:.3f}, the next best place scores "
            f"{self.runner_up_score:.3f}.",
        }[self.finding]

    @property
    def _at_edge(self) -> bool:
        if self.peak is None:
            return False
        rows_searched = self.dy.size > 1 and self.peak[0] in (self.dy[0], self.dy[-1])
        return rows_searched or self.peak[1] in (self.dx[0], self.dx[-1])

    @property
    def _valley_between(self) -> bool:
        """Return whether the scores sink between the peak and the runner-up: two hills, not one broad one."""
        if self.peak is None or self.runner_up is None:
            return False
        first = np.array([self.dy[0], self.dx[0]])
        ends = np.array([self.peak, self.runner_up]) - first
        count = int(np.abs(ends[1] - ends[0]).max()) + 1
        rows, cols = np.rint(np.linspace(ends[0], ends[1], count)).astype(np.intp).T
        lowest = float(np.nanmin(self.surface[rows, cols]))
        return self.runner_up_score - lowest > AMBIGUOUS_MARGIN * abs(self.peak_score)


AMBIGUOUS_MARGIN = 0.03
"""Two scores that differ by a smaller share are as good as equal."""

BARE_CONTRAST = 0.1
"""A window with a smaller share of the picture's contrast is a bare wall."""

POOR_SCORE = 0.6
"""Below this a ZNCC peak is hardly better than chance on a window of some hundred pixels."""


def inspect(matcher: CorrelationMatcher, left: npt.ArrayLike, right: npt.ArrayLike, row: int, col: int) -> Inspection:
    """Score the window around one pixel of the left picture at every lag of the search.

    Parameters
    ----------
    matcher
        Gives window, search area and score.
    left, right
        (H, W), (H, W, 3) or (H, W, 4) images of one size and type.
    row, col
        The pixel; the window is the one from which the matcher takes its disparity.

    Raises
    ------
    ValueError
        Images that are not a pair or are smaller than the window, or a pixel outside them.
    """
    images = as_stereo_pair(left, right)
    height, width = images[0].shape[:2]
    if not (0 <= row < height and 0 <= col < width):
        raise ValueError(
            f"pixel ({row}, {col}) is outside the picture; rows run to {height - 1}, columns to {width - 1}."
        )
    size = matcher.window_size
    if size > min(height, width):
        raise ValueError(f"window_size is {size} px and the images are {width} × {height}; it must fit into them.")
    top, start = (_window_start(at, end, size, matcher.step) for at, end in ((row, height), (col, width)))
    lags = matcher.search.lags(size)
    # Only the rows that the search can reach matter.
    first_row, end_row = max(0, top + lags.dy_first), min(height, top + size + lags.dy_last)
    left_grey, right_grey = as_grey(images[0]), as_grey(images[1])
    query = WindowQuery(
        left_grey[first_row:end_row],
        right_grey[first_row:end_row],
        size,
        matcher.step,
        lags,
        matcher.score,
        circular=matcher.search.circular(size),
    )
    surface = score_surface(query, top - first_row, start)
    dy, dx = np.arange(lags.dy_first, lags.dy_last + 1), np.arange(lags.dx_first, lags.dx_last + 1)
    peak = _highest(surface)
    elsewhere = surface.copy()
    if peak:
        elsewhere[max(0, peak[0] - 1) : peak[0] + 2, max(0, peak[1] - 1) : peak[1] + 2] = np.nan
    second = _highest(elsewhere)
    first_col = max(0, start + lags.dx_first)
    return Inspection(
        window=Box(top, start, size, size),
        search=Box(
            first_row,
            first_col,
            end_row - first_row,
            max(0, min(width, start + size + lags.dx_last) - first_col),
        ),
        found=Box(top + int(dy[peak[0]]), start + int(dx[peak[1]]), size, size) if peak else None,
        surface=surface,
        dy=dy,
        dx=dx,
        peak=(int(dy[peak[0]]), int(dx[peak[1]])) if peak else None,
        runner_up=(int(dy[second[0]]), int(dx[second[1]])) if second else None,
        peak_score=float(surface[peak]) if peak else float("nan"),
        runner_up_score=float(surface[second]) if second else float("nan"),
        offset=_offset_along_row(surface, peak),
        contrast=float(left_grey[top : top + size, start : start + size].std() / (left_grey.std() or 1.0)),
        score=matcher.score,
    )


def with_rows_around(matcher: CorrelationMatcher, rows: int) -> CorrelationMatcher:
    """Return the matcher with a vertical reach of at least `rows` px, to see the hill around a one-row search."""
    lags = matcher.search.lags(matcher.window_size)
    if matcher.search.circular(matcher.window_size) or lags.dy_last >= rows:
        return matcher
    return matcher.model_copy(update={"search": matcher.search.model_copy(update={"vertical": rows})})


def _window_start(at: int, end: int, size: int, step: int) -> int:
    """Return where the window begins whose cell holds the pixel; near the border, the nearest whole window."""
    return int(np.clip((at - (size - step) // 2) // step, 0, (end - size) // step)) * step


def _highest(surface: Surface) -> tuple[int, int] | None:
    if np.isnan(surface).all():
        return None
    row, col = divmod(int(np.nanargmax(surface)), surface.shape[1])
    return row, col


def _offset_along_row(surface: Surface, peak: tuple[int, int] | None) -> float:
    if peak is None or not 0 < peak[1] < surface.shape[1] - 1:
        return 0.0
    around = surface[peak[0], peak[1] - 1 : peak[1] + 2].astype(np.float32)
    return float(peak_offset(around[:1], around[1:2], around[2:])[0])
