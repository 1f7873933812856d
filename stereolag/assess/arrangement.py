"""How the two pictures of a pair are arranged: mirrored, above each other, of two moments, repeating.

All of it is seen in the pictures themselves, before anything is matched densely.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolag.assess.features import FEWEST_MATCHES, Correspondences
from stereolag.assess.orientation import find_correspondences, fundamental_matrix, row_spread, vertical_plane
from stereolag.core.inputs import Image, as_grey

FEW_MATCHES = 400
"""From this number of agreeing features on, both pictures are taken to show the scene the same way round."""

MIRROR_LEAD = 2.5
"""As many times more features agree with a mirrored picture once it is mirrored back."""

VERTICAL_SHARE, LEAST_PARALLAX_PX = 0.35, 1.0
"""Cameras stand above each other if columns scatter by less than this share of what rows do, and rows by more than
this, px at the size at which features were matched."""

FARTHEST_EPIPOLE = 1.5
"""Image widths or heights from the centre up to which an epipole tells that one picture was taken from farther ahead:
cameras of a rig that are turned by so much see no common scene."""

EPIPOLE_ROWS_PX, AGREEING_SHARE = 0.35, 0.8
"""Scatter of the rows from which on an epipole is looked for, and the least share of the matches on epipolar lines."""

EPIPOLE_TRIALS, EPIPOLE_PX = 2000, 1.5
"""Most samples of matches drawn, and the distance from an epipolar line up to which a match agrees, px at the size at
which features were matched."""

REPEATS = 0.7
"""Correlation of the picture with itself from which on it repeats along its rows."""

SAME_TOP = 0.9
"""Share of the highest correlation from which on another top is as high."""

REPEATS_WIDTH = 320
"""Width to which a picture is reduced before repetition is looked for, px."""


@dataclass(frozen=True)
class Epipole:
    """The image of one camera in the picture of the other.

    Attributes
    ----------
    x, y
        Its place in the left picture, in widths and heights from the top left corner; 0.5, 0.5 is the centre.
    """

    x: float
    y: float

    @property
    def inside(self) -> bool:
        """Return whether it lies in the picture."""
        return 0 <= self.x <= 1 and 0 <= self.y <= 1


def mirrored_matches(left: Image, right: Image, found: int) -> int:
    """Return how many features of the left picture agree with the mirror image of the right one; 0 if not many more.

    Nothing is tried where ``FEW_MATCHES`` or more are `found` to agree with the right one as it is.
    """
    if found >= FEW_MATCHES:
        return 0
    mirrored = len(find_correspondences(left, np.ascontiguousarray(right[:, ::-1])))
    return mirrored if mirrored >= max(FEWEST_MATCHES, MIRROR_LEAD * found) else 0


@dataclass(frozen=True, eq=False)
class Views:
    """How points move between two views, whether or not they stay on the same rows.

    Attributes
    ----------
    points
        The matches on the epipolar lines of one fundamental matrix (MAGSAC++, Barath et al. 2020).
    epipole
        The image of the right camera in the left picture, if it is near it. Of cameras side by side it is far beyond
        the picture's sides; between two moments of a moving camera, points move away from it.
    """

    points: Correspondences
    epipole: Epipole | None

    @property
    def above_each_other(self) -> bool:
        """Return whether distance moves points along the columns instead of the rows."""
        given = self.points
        turned = Correspondences(given.left[:, ::-1], given.right[:, ::-1], given.shape[::-1], given.scale)
        rows, columns = _scatter(given), _scatter(turned)
        return rows > LEAST_PARALLAX_PX and columns < VERTICAL_SHARE * rows


def _scatter(points: Correspondences) -> float:
    """Return the scatter of the rows of matches, px at the size at which features were matched."""
    return row_spread(vertical_plane(points)[1]) * points.scale


def find_views(found: Correspondences) -> Views | None:
    """Return how points move between two views; None if too few matches tell.

    Parameters
    ----------
    found
        Matches from :func:`~stereolag.assess.orientation.find_correspondences`. Where they are not nearly all
        candidates, the candidates are taken: the matches were chosen by their rows.
    """
    points = found if found.candidates is None else found.candidates
    if len(points) < FEWEST_MATCHES:
        return None
    lines, agreeing = fundamental_matrix(points, EPIPOLE_PX, EPIPOLE_TRIALS)
    if lines is None or agreeing.mean() < AGREEING_SHARE or agreeing.sum() < FEWEST_MATCHES:
        return None
    chosen = points.chosen(agreeing)
    column, row, depth = np.linalg.svd(lines)[2][2]
    height, width = points.shape
    if _scatter(chosen) < EPIPOLE_ROWS_PX or abs(depth) < 1e-12:
        return Views(chosen, None)
    place = Epipole(float(column / depth / width), float(row / depth / height))
    near = max(abs(place.x - 0.5), abs(place.y - 0.5)) < FARTHEST_EPIPOLE
    return Views(chosen, place if near else None)


def repetition(image: Image) -> float:
    """Return the distance at which a picture repeats along its rows, px; 0 if it does not.

    The correlation of the picture's details with themselves, a shift later, reaches ``REPEATS`` after having fallen
    below half of that.
    """
    scale = min(1.0, REPEATS_WIDTH / image.shape[1])
    size = max(16, round(image.shape[1] * scale)), max(16, round(image.shape[0] * scale))
    grey = cv2.resize(as_grey(image).astype(np.float32), size, interpolation=cv2.INTER_AREA)
    detail = grey - cv2.blur(grey, (size[0] // 6 * 2 + 1, 1))
    lags = size[0] // 2
    correlation = np.ones(lags)
    for lag in range(1, lags):
        one, other = detail[:, :-lag].ravel(), detail[:, lag:].ravel()
        correlation[lag] = float(one @ other) / (float(np.sqrt((one @ one) * (other @ other))) + 1e-12)
    low = np.flatnonzero(correlation < REPEATS / 2)
    if not low.size:
        return 0.0
    later = correlation[low[0] :]
    # Every multiple of the distance fits as well: the first of the highest tops.
    high = np.flatnonzero(later >= SAME_TOP * later.max())
    end = int(np.append(np.flatnonzero(np.diff(high) > 1), high.size - 1)[0])
    first = high[: end + 1]
    return float((low[0] + first[np.argmax(later[first])]) / scale) if later.max() >= REPEATS else 0.0
