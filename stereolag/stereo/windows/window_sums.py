"""Dense windowed correlation by running sums: every window of the left image at every lag."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import Array
from stereolag.core.jobs import Progress, silent
from stereolag.loops.bands import over_bands
from stereolag.loops.vector_lanes import LANES
from stereolag.stereo.windows.matches import WindowMatches, WindowQuery
from stereolag.stereo.windows.prepared_pair import NO_RIGHT_MATCH, PreparedPair
from stereolag.stereo.windows.running_sums import changing_rows
from stereolag.stereo.windows.scores import LeftTerms
from stereolag.stereo.windows.search import MOST_LAGS
from stereolag.stereo.windows.tiles import Workspace, as_right_dx, match_tile

CACHE_BYTES = 512 * 1024
"""Size of the column sums of a tile, which stay in a core's L2 cache."""
GROUP_BYTES = 24 * 1024
"""Size of the scores of a few windows, which stay in a core's L1 cache."""
BAND_WORK = 60e6
"""Pixels times lags of a band: about 50 ms."""


def match_windows(query: WindowQuery, progress: Progress = silent) -> WindowMatches:
    """Find the lag at which each window of the left image correlates best with the right image.

    A lag is a candidate only if its right window is wholly inside the right image, and neither flat (``zncc``) nor
    without energy (``ncc``). Lags whose scores differ by less than float32 and the number of lags can resolve (2e-6 for
    441 of them) are equal, and the shortest displacement among them wins; see :meth:`LagRange.ranked`. The time does
    not depend on the window's size.

    Parameters
    ----------
    query
        uint8 images have exact integer sums, others float64 ones. `right_matches` needs step 1 and a search without
        vertical reach.
    progress
        Called with the fraction done.

    Raises
    ------
    ValueError
        Images that are not grey or differ in size or dtype, a window larger than they are, a step below 1, more than
        65535 lags, a score or a circular correlation that needs a spectrum, or unsupported `right_matches`.
    """
    _check(query)
    matcher = _Matcher(query)
    if matcher.pair.lags is not None and matcher.pair.lags.count > MOST_LAGS:
        raise ValueError(
            f"The search has {matcher.pair.lags.count} lags; window sums allow at most {MOST_LAGS}, "
            "engine 'fft' any number."
        )
    over_bands(matcher.match_band, matcher.pair.rows, most_rows=matcher.most_rows, progress=progress)
    return matcher.pair.matches()


def _check(query: WindowQuery) -> None:
    lags = query.lags
    if query.score not in ("zncc", "ncc", "cross") or query.circular:
        raise ValueError(
            f"The score is {query.score!r}{', circular' if query.circular else ''}; "
            "allowed are 'zncc', 'ncc' and 'cross', none of them circular."
        )
    if query.right_matches and (query.step > 1 or lags.dy_first != 0 or lags.dy_last != 0):
        raise ValueError(
            f"Matches of the right windows need step 1 and no vertical search; the step is {query.step} and "
            f"dy goes from {lags.dy_first} to {lags.dy_last}."
        )


class _Matcher:
    """Prepared pair that the threads share while each matches its own band of rows."""

    def __init__(self, query: WindowQuery) -> None:
        self.pair = PreparedPair(query)

    @property
    def most_rows(self) -> int:
        """Largest number of rows in a band, so that progress comes often enough."""
        pair = self.pair
        work_of_row = pair.width * (pair.lags.count if pair.lags else 1) * min(pair.window, 2 * pair.step) / 2
        return max(1, int(BAND_WORK / work_of_row))

    def match_band(self, first: int, end: int) -> None:
        """Match rows `first` to `end` of the window grid."""
        pair = self.pair
        left = pair.left_windows(first, end)
        if pair.lags is not None:
            right = pair.right_windows(first, end)
            top, bottom = first * pair.step, (end - 1) * pair.step + pair.window + pair.lags.rows - 1
            right_rows = changing_rows(pair.right[top + pair.right_row : bottom + pair.right_row], pair.window)
            found = pair.found._replace(right_key=pair.found.right_key[first:end])
            columns = max(CACHE_BYTES // (pair.table.codes.size * np.dtype(pair.sums_dtype).itemsize), 4 * pair.window)
            tile = max(1, (columns - pair.window) // pair.step + 1)
            work = self._workspace(min((tile - 1) * pair.step + pair.window, pair.width))
            for col in range(0, pair.cols, tile):
                match_tile(
                    pair.left,
                    right_rows,
                    left,
                    right,
                    -top,
                    pair.right_col,
                    pair.table,
                    pair.window,
                    pair.step,
                    pair.share,
                    first,
                    col,
                    min(tile, pair.cols - col),
                    work,
                    found,
                )
        pair.rescale(first, end, left.inverse)
        if pair.lags is not None and pair.right_dx.size:
            margin = max(0, -pair.lags.dx_first)
            keys, right_dx = pair.found.right_key[first:end, margin:], pair.right_dx[first:end]
            as_right_dx(keys, pair.table.dx, pair.table.code_mask, NO_RIGHT_MATCH, right_dx)

    def _workspace(self, columns: int) -> Workspace:
        lags = self.pair.table.codes.size
        group = max(1, GROUP_BYTES // (4 * lags))
        return Workspace(
            columns=_aligned((columns, lags), self.pair.sums_dtype),
            window=_aligned((lags,), self.pair.sums_dtype),
            left=LeftTerms(
                np.zeros(group, self.pair.sums_dtype),
                *(np.zeros(group, np.float32) for _ in ("coarse", "fine", "scale")),
            ),
            scores=_aligned((group, lags + LANES), np.int32),
            best=_aligned((group, LANES), np.int32),
            codes=_aligned((group,), np.int32),
        )


def _aligned(shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
    """Return zeros that start at a cache line, so that no strip straddles two."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    memory = np.zeros(size + 64, np.uint8)
    start = -memory.ctypes.data % 64
    return memory[start : start + size].view(dtype).reshape(shape)
