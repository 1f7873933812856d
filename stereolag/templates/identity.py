"""Whether a place shows the template: light, colour and a shift below a pixel are fitted, and what remains is judged.

Block by block, so that a difference in one place is not lost in the agreement of all others: a sibling of an icon
correlates at 0.95, and so does a landscape with another one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.inputs import Image
from stereolag.templates.patterns import CLOSE, FULL_WEIGHT, Pattern, edges

Plane: TypeAlias = npt.NDArray[np.float32]
Matrix: TypeAlias = npt.NDArray[np.float64]

Kind: TypeAlias = Literal[
    "same", "lower_contrast", "higher_contrast", "partly_covered", "other_colours", "differs", "not_there"
]
"""What a place shows: the template; it with another contrast, or partly covered; its shape in other colours; something
that differs from it in some blocks; something else."""

BLUR = 0.8
"""Spread of the blur, px, after which two renderings of one drawing agree, however it falls on the pixels."""

BLUR_OF_COLOURS = 2.0
"""The same of its colours beside its brightness: JPEG keeps them at half the resolution."""

BLUR_BESIDE = math.sqrt(BLUR_OF_COLOURS**2 - BLUR**2)
"""The blur that brings a blurred brightness to that of the colours."""

STEPS = 8
"""Steps of the alignment; the first of them trust all pixels alike."""

TRUSTING = 3

CURVE = 3
"""Power up to which the curve of tones goes."""

FARTHEST = np.array([1.2, 1.2, 0.05, 0.05])
"""Largest shift down and across, px, and change of size (a logarithm) and angle (radians), of the alignment."""

SETTLED, NONE = 0.002, 1e-6
"""The alignment ends once a step moves no corner by so many px, and changes the colours by no more than what is no
difference: a squared one of the last share of the variance."""

TOLERANCE = 0.5
"""Share of a pixel by which edges may be displaced without counting as a difference."""

BLOCKS, LEAST_BLOCK = 7, 5
"""Blocks along the side of a square template, unless one then has fewer pixels a side than the least."""

DIFFERENT, TIMES, DISPLACED = 0.06, 2.5, 0.004
"""Least mean squared difference of a block that disagrees, as a share of the template's variance, beside so many times
what noise and steepness make of it in the median block; and what of it no displacement by a part of a pixel explains.

Measured without noise: up to 0.05 where the template is, from 0.21 where a sibling is.
"""

THROUGH = 2.0
"""Difference of a block, in units of what is seen of the background there if it varies as the place does."""

STEADY, MOST = 0.01, 0.3
"""Squared gradient that is added to that of a block, and the largest difference of one that agrees, both as shares of
the template's variance."""

EDGE, ALIKE = 0.2, 0.6
"""Least energy of the edges of a shape of one colour in a block that can disagree, as a share of the most in a block;
and the least correlation there with the edges seen, whatever is beside them.

Measured: from 0.75 on photographs where the shape is, up to 0.41 in the worst block of another one in the same ring.
"""

OWN, AS_NEAR, MORE = 12.0, 0.05, 0.2
"""Farthest a shape may be from its colour, grey levels of 255, that is not mixed with what is behind; by how much less
of it, as a logarithm, makes no difference; and the share of a block outside a shape that may be of its colour."""

SLACK, SLACK_OF_SPREAD, CANNOT, AS_BRIGHT = 6.0, 0.25, 0.02, 1.12
"""A pixel can be the template over something behind it if it is beyond the values of that by at most so many grey
levels of 255, and this share of the template's standard deviation; of the pixels of a block so many may not; and the
gains of the channels are 1 up to the last.

Measured: all pixels and gains from 0.96 to 1.10 at glows drawn over photographs; elsewhere from 4 % and 0.3 to 4.
"""

RECOLOURED = 0.037
"""Least squared difference of other colours, as a share of the template's variance, from any gains of the channels.

Measured: up to 0.033 under other lights and in JPEG, from 0.040 for lamps and buttons of another colour.
"""

COUNTS, COUNTED = 0.5, 0.3
"""Least weight of a pixel that can disagree, as the background shows through others; least share of them in a block."""

LEAST_EXPLAINED, LEAST_THROUGH, LEAST_OF_SMALL, SMALL = 0.9, 0.57, 0.95, 256
"""Least share of the variance of a place that an opaque template explains, that one through which the background shows
does, and that an opaque one of fewer pixels than the last.

A few blocks of a few pixels agree by chance. Measured: from 0.97 where the template is, off the grid and in JPEG too;
up to 0.94 at most places where one of 9 px is not.
"""

CHANGED_CONTRAST = 1.25
"""Contrast, or its inverse, from which it is told."""

DIGITS, ROUNDING = 6, float(np.finfo(np.float32).eps)
"""Of the figures of an identity; and the share of its level by which a flat place may vary, computed as it is."""

ALMOST_WHITE = 0.985
"""Share of the largest value of an integer type from which pixels are taken for clipped."""


@dataclass(frozen=True)
class Identity:
    """What a place shows, compared with the template.

    Parameters
    ----------
    kind
        See :data:`Kind`.
    contrast
        Standard deviation of the place over that of the template.
    gain
        For each channel, its contrast: the slope of its values against those of the template.
    explained
        Share of the variance of the place that the template explains.
    blocks
        Rows of blocks over the template: whether they agree.
    """

    kind: Kind
    contrast: float
    gain: tuple[float, ...]
    explained: float
    blocks: tuple[tuple[bool, ...], ...]

    @property
    def is_template(self) -> bool:
        """Whether the place shows all of the template, in whatever light."""
        return self.kind in ("same", "lower_contrast", "higher_contrast")


def identity(image: Image, pattern: Pattern, row: int, col: int, *, posed: bool = False) -> Identity:
    """Return what the image shows at a place of the template.

    Parameters
    ----------
    image
        (rows, cols, channels), as many channels as the pattern.
    pattern
        The template, resized and rotated as at the place.
    row, col
        The place, accurate to a pixel.
    posed
        Whether size and angle are refined too.
    """
    if pattern.silhouette:
        return _identity_of_shape(image, pattern, row, col)
    over = None
    if pattern.most_opaque and image.dtype.kind == "u":  # accurate to a pixel: a slope behind it moves the best score
        near = ((down, right) for down in (0, -1, 1) for right in (0, -1, 1))
        tried = (_gain_over_something(image, pattern, row + down, col + right) for down, right in near)
        over = next((one for one in tried if one is not None), None)
    if over is not None:
        return _told("same", 1.0, *over, np.ones(_grid(pattern.shape), dtype=np.bool_))
    fit = _Fit(image, pattern, row, col, posed)
    if not fit.variance > 0 or fit.contrast <= 0:
        return Identity("not_there", 0.0, (0.0,) * pattern.colours.shape[2], 0.0, ())
    counts = fit.averaged(None) > COUNTED
    disagrees = fit.disagrees(counts) & (fit.averaged(fit.differences()) > DISPLACED)
    structure = fit.structure()
    agrees = ~disagrees & (counts | (structure == 0))
    seen = float(structure[agrees].sum() / max(structure.sum(), 1e-12))
    kind = _kind(fit, disagrees, structure, seen, outside=not agrees[~disagrees].all())
    return _told(kind, fit.contrast, fit.gain, fit.explained, agrees)


def _identity_of_shape(image: Image, pattern: Pattern, row: int, col: int) -> Identity:
    """Return what the image shows at a place of a silhouette: the edges in every block, and none of its colour beside.

    The last channel of the image is highest where it has the silhouette's colour, the others are its edges.
    """
    height, width = pattern.shape
    part = np.nan_to_num(image[row : row + height, col : col + width])
    alpha, seen, near = pattern.colours[:, :, 0], part[:, :, :2], part[:, :, 2]
    own, grid = edges(pattern.colours), _grid(pattern.shape)
    on = np.square(own).sum(axis=2)
    there, common, here = (
        _averaged(one, grid)
        for one in (on, (own * seen).sum(axis=2), np.square(seen).sum(axis=2) * (on > EDGE**2 * on.max()))
    )
    edged = there > EDGE * there.max()
    agrees = ~edged | (common > ALIKE * np.sqrt(there * here))
    inside = near[alpha >= alpha.max() * FULL_WEIGHT]
    if np.median(inside) > -math.log(CLOSE + OWN):
        beside = cv2.dilate(np.asarray(alpha, dtype=np.float32), np.ones((3, 3), np.uint8)) < 1 - FULL_WEIGHT
        agrees &= _averaged(beside & (near > np.quantile(inside, 0.1) - AS_NEAR), grid) <= MORE
    explained = float(common.sum() ** 2 / max(there.sum() * here.sum(), 1e-12)) if common.sum() > 0 else 0.0
    shown = float(there[agrees].sum() / there.sum())
    kind: Kind = "same" if agrees.all() else "differs" if shown >= DIFFERS else "not_there"
    return _told(kind, 1.0, (1.0,), explained, agrees)


def _gain_over_something(image: Image, pattern: Pattern, row: int, col: int) -> tuple[tuple[float, ...], float] | None:
    """Return gains and explained share if the place can be the template over something behind it; else None.

    What is behind is any of the values that a pixel can have; to tell the gains, it is taken for a slope.
    """
    height, width = pattern.shape
    part = image[max(row, 0) : max(row + height, 0), max(col, 0) : max(col + width, 0)].astype(np.float64)
    if part.shape[:2] != pattern.shape:
        return None
    top = float(np.iinfo(image.dtype).max)
    alpha = pattern.most_opaque * np.cbrt(pattern.weights)[:, :, np.newaxis]
    over, through = alpha * pattern.colours, 1 - alpha
    spread = float(np.sqrt((pattern.weights * np.square(pattern.deviations).sum(axis=0)).sum() / pattern.count))
    slack = min(SLACK * top / 255, SLACK_OF_SPREAD * spread)
    cannot = ((part < over - slack) | (part > over + through * top + slack)).any(axis=2) & (pattern.weights > 0)
    if _averaged(cannot, _grid(pattern.shape)).max() > CANNOT:
        return None
    on = pattern.weights > 0
    weights = np.sqrt(pattern.weights[on])
    rows, cols = (at[:, np.newaxis] / max(on.shape) for at in np.nonzero(on))
    gains, left, varies = [], 0.0, 0.0
    for channel in range(part.shape[2]):
        seen, shown, behind = part[:, :, channel][on], over[:, :, channel][on], through[on]
        terms = np.column_stack([shown, behind, behind * rows, behind * cols])
        weighted = terms * weights[:, np.newaxis]
        ridge = 1e-3 * weights.sum() * np.diag([0, 1, 1, 1]) + np.diag([1e-9 + 1e-9 * float(shown @ shown), 0, 0, 0])
        fitted = np.linalg.solve(terms.T @ weighted + ridge, weighted.T @ seen)
        gains.append(float(fitted[0]))
        left += float(weights @ np.square(seen - terms @ fitted))
        varies += float(weights @ np.square(seen - np.average(seen, weights=weights)))
    if not all(1 / AS_BRIGHT <= gain <= AS_BRIGHT for gain in gains):
        return None
    return tuple(gains), max(0.0, 1 - left / varies) if varies > 0 else 0.0


def _told(
    kind: Kind, contrast: float, gain: tuple[float, ...], explained: float, agrees: npt.NDArray[np.bool_]
) -> Identity:
    """Return an identity, its figures to as many digits as single precision holds: those of an exact copy are 1."""
    contrast, explained, *gains = (float(f"{figure:.{DIGITS}g}") for figure in (contrast, explained, *gain))
    return Identity(kind, contrast, tuple(gains), explained, tuple(tuple(map(bool, line)) for line in agrees))


def _grid(shape: tuple[int, int]) -> tuple[int, int]:
    """Return rows and columns of the blocks of a template."""
    side = max(LEAST_BLOCK, math.sqrt(shape[0] * shape[1]) / BLOCKS)
    return max(1, round(shape[0] / side)), max(1, round(shape[1] / side))


class _Fit:
    """A template fitted to a place: shift, mixture of the colours, and what remains."""

    def __init__(self, image: Image, pattern: Pattern, row: int, col: int, posed: bool) -> None:
        self.own_weights = pattern.weights.astype(np.float32)
        self.weights = _inside(self.own_weights, image, row, col)
        self.shape = pattern.shape
        on = self.weights > 0
        self._on = slice(None) if on.all() else on.ravel()
        self.is_opaque = bool((self.own_weights[on] >= 1).all())
        self._deviations = np.moveaxis(pattern.deviations, 0, 2).astype(np.float32)
        blur = _Blur(self.own_weights)
        template = self.template = blur(self._deviations)
        if not np.array_equal(self.weights, self.own_weights):
            blur = _Blur(self.weights)
        given = self._flat(template)
        # Where the template's mean is 0 too, float32 holds the values of a place on any pedestal.
        first = np.nonzero(on)[0][0], np.nonzero(on)[1][0]
        mean = pattern.colours[first].astype(np.float64) - pattern.deviations[:, first[0], first[1]]
        place = _Place(image, mean, row, col, self.shape)
        channels, about = given.shape[1], np.atleast_2d(np.cov(given.T, bias=True))
        spread = float(about.trace())
        terms = np.column_stack([given, np.ones(len(given), np.float32)])
        # Where only a flat part of the template is inside the image, its level alone keeps the mixture solvable.
        least = 1e-4 * spread + 1e-9 * float(np.square(given.mean(axis=0, dtype=np.float64)).sum())
        ridge = np.diag([(least or 1.0) * len(given)] * channels + [0.0])
        trust = counts = self._flat(self.weights)
        reach = np.array([1, 1, sum(self.shape) / 2, sum(self.shape) / 2])
        motion = moved = np.zeros(4)
        self._mixture = np.zeros((channels + 1, channels))
        for step in range(STEPS):
            self.seen = blur(place.moved(motion))
            seen = self._flat(self.seen)
            weighted = (terms * trust[:, np.newaxis]).astype(np.float64)
            products, sums = weighted.T @ terms, weighted.T @ seen
            # A template of few colours leaves the mixture open: the nearest to one gain of all channels is taken.
            energies = (products.diagonal() - np.square(products[-1]) / products[-1, -1])[:-1]
            common = sums[:-1].diagonal() - products[-1, :-1] * sums[-1] / products[-1, -1]
            gain = float(common.sum() / energies.sum()) if energies.sum() > 0 else 0.0
            alike = np.vstack([gain * np.eye(channels), np.zeros(channels)])
            before, self._mixture = self._mixture, np.linalg.solve(products + ridge, sums + ridge @ alike)
            self._curves: list[tuple[float, Matrix] | None] = [None] * channels
            self.predicted = self._as_seen(template)
            residual = seen - self._flat(self.predicted)
            variance = float((self._mixture[:-1].T @ about @ self._mixture[:-1]).trace())
            rounding = ROUNDING**2 * float(np.square(self._mixture[-1]).sum())
            self.variance = variance if variance > rounding else 0.0
            squares = np.einsum("ij,ij->i", residual, residual)
            other = self._mixture - before
            changed = float((other[:-1].T @ about @ other[:-1]).trace() + np.square(other[-1]).sum())
            settled = step > TRUSTING and np.abs(moved) @ reach < SETTLED and changed < NONE * self.variance
            if step == STEPS - 1 or settled or not self.variance > 0:
                break
            moved = _motion(self.predicted, residual, on, trust, posed)
            motion = np.clip(motion + moved, -FARTHEST, FARTHEST)
            if step >= TRUSTING - 1:  # pixels that something else covers are trusted ever less
                usual = max(0.06 * self.variance, 2 * float(np.median(squares)))
                trust = np.asarray(counts / np.square(1 + squares.astype(np.float64) / usual), dtype=np.float32)
            elif step and squares.max() < NONE * self.variance:
                break
        planes = template, self.predicted, self.seen
        soft, lit, shown = (self._flat(blur.softened(one)).astype(np.float64) + mean for one in planes)
        self.recoloured = _recoloured(soft, lit, shown, (trust * (counts >= COUNTS)).astype(np.float64), image.dtype)
        if squares.max() >= NONE * self.variance:
            self._curves = self._tones(seen.astype(np.float64), trust.astype(np.float64))
            self.predicted = self._as_seen(template)
            residual = seen - self._flat(self.predicted)
        self._beside = place.moved(motion)
        behind = 0.0 if self.is_opaque else float(self._beside.var(axis=(0, 1)).sum())
        self.shown_through = behind * np.square(1 - np.cbrt(self.weights))
        self.contrast = math.copysign(math.sqrt(self.variance / spread), gain) if spread > 0 else 0.0
        self.gain = tuple(
            float(common[one] / energies[one]) if np.ptp(given[:, one]) else self.contrast for one in range(channels)
        )
        around = seen - counts @ seen / counts.sum()
        varies = float(counts @ np.einsum("ij,ij->i", around, around))
        left = float(counts @ np.einsum("ij,ij->i", residual, residual))
        self.explained = max(0.0, 1 - left / varies) if varies > 0 else 0.0

    def _flat(self, plane: Plane) -> Plane:
        """Return the pixels of a plane that count, one after another."""
        return np.asarray(plane.reshape(self.weights.size, *plane.shape[2:])[self._on])

    def _tones(self, seen: Matrix, trust: Matrix) -> list[tuple[float, Matrix] | None]:
        """Return for each channel a curve of the predicted tones over their spread, if it rises throughout; and that.

        A screen's or camera's gamma is one. What a sibling has elsewhere is none.
        """
        curves: list[tuple[float, Matrix] | None] = []
        predicted = self._flat(self.predicted).astype(np.float64)
        for channel, tones in enumerate(predicted.T):
            spread = tones.std()
            curves.append(None)
            if not spread > 1e-4 * np.abs(tones).max():  # its powers cannot be told apart
                continue
            terms = np.vander(tones / spread, CURVE + 1)
            weighted = terms * trust[:, np.newaxis]
            ridge = 1e-6 * trust.sum() * np.eye(CURVE + 1)
            curve = np.linalg.solve(terms.T @ weighted + ridge, weighted.T @ seen[:, channel])
            ends = np.linspace(tones.min(), tones.max(), 17) / spread
            if (np.diff(np.polyval(curve, ends)) > 0).all():
                curves[-1] = float(spread), curve
        return curves

    def _as_seen(self, plane: Plane) -> Plane:
        """Return colours of the template in the light of the place, 0 where they do not count."""
        mixture = self._mixture.astype(np.float32)
        lit = plane @ mixture[:-1] + mixture[-1]
        for channel, curve in enumerate(self._curves):
            if curve is not None:
                spread, powers = curve
                lit[:, :, channel] = np.polyval(powers.astype(np.float32), lit[:, :, channel] / np.float32(spread))
        if not isinstance(self._on, slice):
            lit[self.weights == 0] = 0
        return np.asarray(lit)

    def differences(self, *, sharp: bool = False) -> Plane:
        """Return what no displacement of edges by a part of a pixel explains, squared, summed over channels.

        Of the blurred images, or of the sharp ones.
        """
        predicted, seen = self.predicted, self.seen
        if sharp:
            predicted, seen = self._as_seen(self._deviations), self._beside
        least = np.minimum(_beyond(seen, predicted), _beyond(predicted, seen))
        return np.asarray(np.square(least).sum(axis=2) * (self.weights >= COUNTS))

    def averaged(self, plane: Plane | None) -> Plane:
        """Return the mean over each block of what counts, as a share of the variance; None: the share that counts."""
        inside = _averaged(self.weights >= COUNTS, _grid(self.shape))
        if plane is None:
            return inside
        total = _averaged(plane * (self.weights >= COUNTS), _grid(self.shape))
        return np.asarray(total / np.maximum(inside, 1e-6) / self.variance, dtype=np.float32)

    def disagrees(self, counts: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return the blocks that differ by more than noise, which is in all blocks alike or as they are steep."""
        if not counts.any():
            return counts
        left = self.averaged(np.square(self.seen - self.predicted).sum(axis=2))
        steep = self.averaged(sum(np.square(one).sum(axis=2) for one in _gradient(self.predicted))) + STEADY
        noise = np.maximum(np.median(left[counts]), steep * np.median((left / steep)[counts]))
        behind = THROUGH * self.averaged(self.shown_through)
        return np.asarray((left > np.minimum(DIFFERENT + TIMES * noise, MOST) + behind) & counts)

    def structure(self) -> Plane:
        """Return the energy of each block of the template about its own mean."""
        weights = self.own_weights[:, :, np.newaxis]
        share = _averaged(self.own_weights, _grid(self.shape))
        means, squares = (
            [_averaged(one, _grid(self.shape)) / np.maximum(share, 1e-6) for one in np.moveaxis(weights * power, 2, 0)]
            for power in (self.template, np.square(self.template))
        )
        energy = np.sum(squares, axis=0) - np.square(means).sum(axis=0)
        return np.asarray(np.where(share > COUNTED, np.maximum(energy, 0) * share, 0))


def _inside(weights: Plane, image: Image, row: int, col: int) -> Plane:
    """Return the weights, 0 outside the image and within 2 px of pixels without data."""
    known = np.zeros(weights.shape, dtype=np.uint8)
    top, left = max(row, 0), max(col, 0)
    part = np.isfinite(image[top : max(row + weights.shape[0], 0), left : max(col + weights.shape[1], 0)]).all(axis=2)
    flags = np.asarray(part, dtype=np.uint8)
    around = flags if flags.all() else cv2.erode(flags, np.ones((5, 5), np.uint8))
    known[top - row :, left - col :][: part.shape[0], : part.shape[1]] = around
    return np.asarray(weights * known, dtype=np.float32)


class _Blur:
    """A blur without what its weights exclude, of colours more than of brightness."""

    def __init__(self, weights: Plane) -> None:
        self._weights = None if (weights == 1).all() else weights[:, :, np.newaxis]
        self._shares = {
            blur: np.maximum(_spread(weights, blur), 1e-3)[:, :, np.newaxis]
            for blur in (BLUR, BLUR_OF_COLOURS, BLUR_BESIDE)
        }

    def __call__(self, image: Plane) -> Plane:
        """Return an image blurred."""
        bright = _bright(image)
        blurred = self._of(bright, BLUR)
        return blurred if image.shape[2] == 1 else blurred + self._of(image - bright, BLUR_OF_COLOURS)

    def softened(self, image: Plane) -> Plane:
        """Return a blurred image with its brightness blurred as its colours are."""
        bright = _bright(image)
        return np.asarray(image - bright + self._of(bright, BLUR_BESIDE))

    def _of(self, image: Plane, blur: float) -> Plane:
        weighted = image if self._weights is None else image * self._weights
        return np.asarray(_spread(weighted, blur).reshape(image.shape) / self._shares[blur])


def _spread(image: Plane, blur: float) -> Plane:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), blur, borderType=cv2.BORDER_CONSTANT))


def _bright(image: Plane) -> Plane:
    channels = image.shape[2]
    bright = image if channels == 1 else cv2.transform(image, np.full((1, channels), 1 / channels))
    return np.asarray(bright, dtype=np.float32).reshape(*image.shape[:2], 1)


class _Place:
    """What an image shows around a place, less the template's mean."""

    def __init__(self, image: Image, mean: Matrix, row: int, col: int, shape: tuple[int, int]) -> None:
        margin = 3
        top, left = max(0, row - margin), max(0, col - margin)
        part = image[top : max(top, row + shape[0]) + margin, left : max(left, col + shape[1]) + margin]
        self._part = np.nan_to_num((part - mean).astype(np.float32))
        self._corner = np.array([col - left, row - top])
        self._shape = shape

    def moved(self, motion: Matrix) -> Plane:
        """Return the place moved by (rows, cols, logarithm of size, angle)."""
        down, right, size, angle = motion
        cosine, sine = math.exp(size) * math.cos(angle), math.exp(size) * math.sin(angle)
        linear = np.array([[cosine, -sine], [sine, cosine]])
        middle = (np.array(self._shape[::-1]) - 1) / 2
        offset = middle + self._corner + np.array([right, down]) - linear @ middle
        moved = cv2.warpAffine(
            self._part,
            np.column_stack([linear, offset]),
            self._shape[::-1],
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        return np.asarray(moved, dtype=np.float32).reshape(*self._shape, -1)


def _gradient(image: Plane) -> list[Plane]:
    """Return the derivatives down and to the right."""
    return [
        np.asarray(cv2.Sobel(image, cv2.CV_32F, *order, ksize=3, scale=1 / 8), dtype=np.float32).reshape(image.shape)
        for order in ((0, 1), (1, 0))
    ]


def _motion(predicted: Plane, residual: Plane, on: npt.NDArray[Any], trust: Plane, posed: bool) -> Matrix:
    """Return the motion of the place, as :meth:`_Place.moved` takes it, that explains most of the residual."""
    down, right = (one[on] for one in _gradient(predicted))
    motions = [-down, -right]
    if posed:
        rows, cols = (at[:, np.newaxis] - (side - 1) / 2 for at, side in zip(np.nonzero(on), on.shape, strict=True))
        motions += [-(rows * down + cols * right), rows * right - cols * down]
    terms = np.stack(motions).astype(np.float32)
    weighted = (terms * trust[:, np.newaxis]).reshape(len(terms), -1)
    products = (weighted @ terms.reshape(len(terms), -1).T).astype(np.float64)
    products[np.diag_indices(len(products))] += 1e-9 + 1e-6 * products.diagonal()
    moved = np.zeros(4)
    moved[: len(motions)] = np.linalg.solve(products, weighted @ residual.ravel())
    return moved


def _recoloured(given: Matrix, predicted: Matrix, seen: Matrix, trust: Matrix, dtype: np.dtype[Any]) -> float:
    """Return how far the fitted colours are from a gain of each channel and an offset of all, as a share of variance.

    A light or a camera multiplies channels; haze and exposure add to all. Pixels that the image clips could be
    brighter, and do not count in the fit.
    """
    channels = given.shape[1]
    if channels == 1:
        return 0.0
    top = float(np.iinfo(dtype).max) if dtype.kind == "u" else math.inf
    products, sums = np.zeros((channels + 1, channels + 1)), np.zeros(channels + 1)
    for one in range(channels):
        weights = trust * (seen[:, one] < ALMOST_WHITE * top)
        terms = np.column_stack([given[:, one], np.ones(len(given))])
        at = np.ix_([one, channels], [one, channels])
        products[at] += terms.T @ (terms * weights[:, np.newaxis])
        sums[[one, channels]] += terms.T @ (weights * predicted[:, one])
    products[np.diag_indices(channels + 1)] += 1e-12 * (1 + np.trace(products))
    *gains, offset = np.linalg.solve(products, sums)
    lit = np.minimum(given * gains + offset, top)
    away = np.square(np.minimum(predicted, top) - lit).sum(axis=1)
    return float(np.average(away, weights=trust) / max(predicted.var(axis=0).sum(), 1e-12))


def _beyond(one: Plane, other: Plane) -> Plane:
    """Return by how much one image leaves the range of the other within a part of a pixel around."""
    square = np.ones((3, 3), np.uint8)
    highest, lowest = (change(other, square).reshape(other.shape) for change in (cv2.dilate, cv2.erode))
    upper, lower = other + TOLERANCE * (highest - other), other + TOLERANCE * (lowest - other)
    return np.asarray(np.maximum(np.maximum(lower - one, one - upper), 0))


def _averaged(plane: npt.NDArray[Any], shape: tuple[int, int]) -> Plane:
    smaller = cv2.resize(np.ascontiguousarray(plane, dtype=np.float32), shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(smaller, dtype=np.float32).reshape(shape)


COVERED, LEAST_COVERED = (0.08, 0.45), 2304
"""Smallest and largest share of the pixels that a thing in front may hide, and of how many at least: with the mark of
an icon covered, nobody can tell it from its sibling."""

CERTAIN, CLEARLY, SLIGHTLY = 0.9, 4.0, 0.004
"""A pixel differs by more than so many times what this share of those in the blocks that agree does, and by more than
a share of the template's variance."""

FILLED, ONE = 0.76, 0.9
"""Least share of the pixels that differ where something is in front, and least share of those that differ there.

A sibling shares its ground with the template. Measured: from 0.79 where something is in front, up to 0.73 elsewhere.
"""

FROM_RIM, FILLED_NOISY, LEFT_NOISY = (0.1, 0.45), 0.6, 0.55
"""The same where noise hides the pixels of its rim: smallest and largest share of the blocks, least share of the pixels
that differ in them, and of the structure that must be seen, of a thing that comes in over the rim of the template."""

LEFT_OVER, LEFT_INSIDE, DIFFERS = 0.45, 0.4, 0.4
"""Least share of the template's structure that must be seen if a part is covered, if only a part is outside, and of
something that differs in some blocks."""


def _kind(fit: _Fit, disagrees: npt.NDArray[np.bool_], structure: Plane, seen: float, *, outside: bool) -> Kind:
    """Return what a place shows, from the blocks that disagree and the share of the structure seen in all others."""
    if not fit.is_opaque and fit.explained < LEAST_THROUGH:
        return "not_there"
    if disagrees.any():
        if fit.recoloured < RECOLOURED and (
            _hides(fit, disagrees, structure) or (seen >= LEFT_NOISY and _comes_in(fit, disagrees))
        ):
            return "partly_covered"
        return "differs" if seen >= DIFFERS else "not_there"
    least = LEAST_OF_SMALL if math.prod(fit.shape) < SMALL else LEAST_EXPLAINED
    if fit.is_opaque and fit.explained < least:
        return "differs"
    if fit.recoloured >= RECOLOURED:
        return "other_colours"
    if outside:
        return "partly_covered" if seen >= LEFT_INSIDE else "not_there"
    if 1 / CHANGED_CONTRAST < fit.contrast < CHANGED_CONTRAST:
        return "same"
    return "lower_contrast" if fit.contrast < 1 else "higher_contrast"


def _hides(fit: _Fit, disagrees: npt.NDArray[np.bool_], structure: Plane) -> bool:
    """Return whether all blocks that disagree hold or touch one thing in front, whose every pixel does."""
    counts = fit.weights >= COUNTS
    if counts.sum() < LEAST_COVERED:
        return False
    squares = fit.differences(sharp=True)
    there = cv2.resize(disagrees.astype(np.uint8), fit.shape[::-1], interpolation=cv2.INTER_NEAREST) == 0
    noise = float(np.quantile(squares[there & counts], CERTAIN)) if (there & counts).any() else math.inf
    differ = squares > min(max(CLEARLY * noise, SLIGHTLY * fit.variance), DIFFERENT * fit.variance)
    closed = cv2.morphologyEx(differ.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    found, _ = cv2.findContours(
        cv2.morphologyEx(closed, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)),
        cv2.RETR_EXTERNAL,
        cv2.CHAIN_APPROX_SIMPLE,
    )
    if not found:
        return False
    front = cv2.fillConvexPoly(np.zeros(fit.shape, np.uint8), cv2.convexHull(max(found, key=cv2.contourArea)), 1) > 0
    reach = 2 * math.ceil(3 * BLUR_OF_COLOURS) + 1
    touched = cv2.dilate(np.asarray(front, dtype=np.uint8), np.ones((reach, reach), np.uint8))
    if (disagrees & (_averaged(touched, structure.shape) == 0)).any():
        return False
    share = (front & counts).sum() / counts.sum()
    left = float((structure * (1 - _averaged(front, structure.shape))).sum() / max(structure.sum(), 1e-12))
    filled, one = differ[front & counts].mean(), (differ & front).sum() / differ.sum()
    return bool(COVERED[0] <= share <= COVERED[1] and left >= LEFT_OVER and filled >= FILLED and one >= ONE)


def _comes_in(fit: _Fit, disagrees: npt.NDArray[np.bool_]) -> bool:
    """Return whether the blocks that disagree are one thing in front that comes in over the rim of the template."""
    if not FROM_RIM[0] <= disagrees.mean() <= FROM_RIM[1]:
        return False
    _, labels, stats, _ = cv2.connectedComponentsWithStats(disagrees.astype(np.uint8), connectivity=4)
    region = labels == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    rim = region[0].any() or region[-1].any() or region[:, 0].any() or region[:, -1].any()
    if not rim or region.sum() < 0.8 * disagrees.sum():
        return False
    there = cv2.resize(disagrees.astype(np.uint8), fit.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    differ = fit.differences()[there & (fit.weights >= COUNTS)] > 0.02 * fit.variance
    return bool(differ.mean() >= FILLED_NOISY)
