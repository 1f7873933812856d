"""A template fitted to a place: a shift below a pixel, the light and its colours; and what remains, block by block."""

from __future__ import annotations

import math
from functools import partial
from itertools import product
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stereolag.core.arrays import median
from stereolag.core.inputs import Image
from stereolag.templates.aligning import AROUND, FARTHEST, Matrix, Motions, Place, Plane, gradient
from stereolag.templates.differences import another_mark, beyond, explained, squares
from stereolag.templates.patterns import FULL_WEIGHT, Pattern
from stereolag.templates.softening import LEAST_MIXED, Blur, Rim

STEPS = 8
"""Steps of the alignment; the first of them trust all pixels alike."""

TRUSTING = 3

CURVE, FLATTEST = 3, 0.1
"""Power up to which the curve of tones goes, and its least slope beside its steepest.

Measured: from 0.18 under gammas of 0.55 to 1.8; 0.04 where it made one round spot of another, half as wide.
"""

SOFTEST, SHARPEST, SOFTER, OF_RIM = 1.0, -0.4, 0.02, 1.5
"""Largest blur of a place over that of the template, its squared spread, px, and the least, of a place sharper than the
template; the least change of it; and so many times its spread what is beyond the rim is mixed in."""

SETTLED, NONE = 0.002, 1e-6
"""The alignment ends once a step moves no corner by so many px, unless told otherwise, and changes the colours by no
more than what is no difference: a squared one of the last share of the variance."""

BLOCKS, LEAST_BLOCK = 7, 5
"""Blocks along the side of a square template, unless one then has fewer pixels a side than the least."""

DIFFERENT, TIMES, OF_STEEP, DISPLACED = 0.06, 2.5, 0.4, 0.003
"""Least mean squared difference of a block that disagrees, as a share of the template's variance, beside so many times
what noise and steepness make of it in the median block; how much steepness can make; and what of it no displacement by
a part of a pixel explains.

Measured without noise: up to 0.05 where the template is, from 0.21 where a sibling is. Over how steep a block is: up to
0.3 in the median block where the template is, 1.1 where most blocks show something else.
"""

FAINT, SHIFTED, EXACT = 0.02, 0.25, 10.0
"""Least difference of a faint block that disagrees where all others fit exactly, and share of how steep it is, as if it
was moved by half a pixel; beside so many times the noise.

Measured: a word in faint letters beside clear ones has 0.03 to 0.06, and a suit for another one of 13 px 0.05 to 0.17.
"""

THROUGH = 2.0
"""Difference of a block, in units of what is seen of the background there if it varies as the place does."""

MOVES_AT_MOST = 3.0
"""Roots of a block's mean squared gradient that it changes at most when it is moved by a pixel each way."""

SAMPLED = 2**16
"""Pixels, evenly spread, that tell what a slope or a bend explains."""

OF_MOVED = 0.5
"""Share of a difference that may remain where it is due to a move."""

PARTED = (-1.0, -0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
"""Shifts of a part of the template against the rest, px."""

STEADY, MOST = 0.01, 0.3
"""Squared gradient that is added to that of a block, and the largest difference of one that agrees, both as shares of
the template's variance."""

COUNTS, COUNTED = 0.5, 0.3
"""Least weight of a pixel that can disagree, as the background shows through others; least share of them in a block."""

OPAQUE = 0.6
"""Least share of the pixels of an opaque template through which no background shows."""

ROUNDING = float(np.finfo(np.float32).eps)
"""The share of its level by which a flat place may vary, computed as it is."""

GRAIN = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32) / 6
"""Filter that keeps the variance of noise and nothing of planes."""

ALMOST_WHITE = 0.985
"""Share of the largest value of an integer type from which pixels are taken for clipped."""


TINTED, TINT = (0.4, 1.0), 0.1
"""Gains under a tint, and the share of what gains of the channels leave that it has to leave at most."""

WHITE, NEUTRAL, NEARLY, LEAST_WHITE, COLOURED = 200, 12, 20, 8, 25
"""Least value of white, greatest difference of its channels in the template and where it is seen, least number of such
pixels, and by how much more the channels differ in a light that colours it, grey levels of 255."""


def blocks_of(shape: tuple[int, int]) -> tuple[int, int]:
    """Return rows and columns of the blocks of a template."""
    side = max(LEAST_BLOCK, math.sqrt(shape[0] * shape[1]) / BLOCKS)
    return max(1, round(shape[0] / side)), max(1, round(shape[1] / side))


class Fit:
    """A template fitted to a place.

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
    settled
        The alignment ends once a step moves no corner by so many px.
    sharp
        Whether the place is as sharp as the template; otherwise its blur is fitted too.
    """

    def __init__(
        self,
        image: Image,
        pattern: Pattern,
        row: int,
        col: int,
        posed: bool,
        settled: float = SETTLED,
        *,
        sharp: bool = False,
    ) -> None:
        self.own_weights = pattern.weights.astype(np.float32)
        self.weights = _inside(self.own_weights, image, row, col)
        self.shape = pattern.shape
        on = self.weights > 0
        self._on = slice(None) if on.all() else on.ravel()
        # But for the rim of one that was resized.
        self.is_opaque = bool((self.own_weights[on] >= FULL_WEIGHT).mean() >= OPAQUE)
        self._deviations = np.moveaxis(pattern.deviations, 0, 2).astype(np.float32)
        self._known, blur = self.weights, Blur(self.weights)
        self._counts = self._flat(self.weights)
        self._soften(blur(self._deviations), 0.0)
        # Where the template's mean is 0 too, float32 holds the values of a place on any pedestal.
        first = np.nonzero(on)[0][0], np.nonzero(on)[1][0]
        mean = pattern.colours[first].astype(np.float64) - pattern.deviations[:, first[0], first[1]]
        self._place = partial(Place, image, mean, row, col, self.shape)  # planes are large, and two fits are compared
        place = self._place()
        channels = self._given.shape[1]
        self._mixture = np.zeros((channels + 1, channels))
        self._curves: list[tuple[float, Matrix] | None] = [None] * channels
        self.seen = self.predicted = self.template
        self.variance = 0.0
        self.motion, trust = self._aligned(place, blur, posed, settled, sharp)
        rim = round(OF_RIM * math.sqrt(max(self._softer, 0.0)))
        inner = np.s_[rim:-rim, rim:-rim]
        if rim and self.weights[inner].sum() > LEAST_BLOCK**2 and self._energy(inner) > self._energy(np.s_[:]) / 2:
            blur, trust = self._without_rim(rim, place, trust)
        self._beside = place.moved(self.motion)
        soft, lit, shown = (
            self._flat(blur.softened(one)).astype(np.float64) + mean
            for one in (self.template, self.predicted, self.seen)
        )
        trusted = (trust * (self._counts >= COUNTS)).astype(np.float64)
        self.recoloured, light = _recoloured(soft, lit, shown, trusted, image.dtype)
        if light is not None and image.dtype == np.uint8 and self._keeps_white(pattern, mean, light):
            self.recoloured = 1.0
        if squares(self._residual()).max() >= NONE * self.variance:
            self._curves = self._tones(trust.astype(np.float64))
            self.predicted = self._as_seen(self.template)
        behind = 0.0 if (self.own_weights[on] >= 1).all() else float(self._beside.var(axis=(0, 1)).sum())
        self.shown_through = behind * np.square(1 - np.cbrt(self.weights))

    def _soften(self, template: Plane, softer: float) -> None:
        """Compare the template blurred by so much more than the place, a squared spread, px."""
        self._softer = softer
        self.template = template
        self._given = self._flat(self.template)
        covariance = cv2.COVAR_NORMAL | cv2.COVAR_ROWS | cv2.COVAR_SCALE
        self._about = cv2.calcCovarMatrix(self._given, None, covariance, ctype=cv2.CV_64F)[0]  # type: ignore[call-overload]
        self._terms = np.vstack([self._given.T, np.ones(len(self._given))]).astype(np.float64)
        # Where only a flat part of the template is inside the image, its level alone keeps the mixture solvable.
        level = float(np.square(self._given.mean(axis=0, dtype=np.float64)).sum())
        least = (1e-4 * float(self._about.trace()) + 1e-9 * level) or 1.0
        self._ridge = np.diag([least * len(self._given)] * self._given.shape[1] + [0.0])

    def _energy(self, some: Any) -> float:
        """Return the energy of the template in some of its pixels."""
        part = self._deviations[some]
        return float(np.einsum("ijk,ijk,ij", part, part, self.weights[some]))

    def _without_rim(self, rim: int, place: Place, trust: Plane) -> tuple[Blur, Plane]:
        """Fit the light without the rim, so many px, with which what is beyond it is mixed; return blur and trust."""
        inner = np.zeros_like(self.weights)
        inner[rim:-rim, rim:-rim] = 1
        self.weights = self.weights * inner
        self._counts, trust, blur = self._flat(self.weights), trust * self._flat(inner), Blur(self.weights)
        # What is at its own rim is mixed in with all else.
        self._soften(blur(self._as_soft()), self._softer)
        self.seen = blur(place.moved(self.motion))
        self._mixture = self._in_light(trust)
        self.predicted = self._as_seen(self.template)
        return blur, trust

    def _keeps_white(self, pattern: Pattern, mean: Matrix, light: Matrix) -> bool:
        """Return whether what is white is seen in no colour, though the gains and the offset of a light colour it.

        A few letters on a button count as little as their area, but tell that its other colour is not due to light.
        """
        white = (pattern.colours.min(axis=2) >= WHITE) & (np.ptp(pattern.colours, axis=2) <= NEUTRAL) & self.counted
        if white.sum() < LEAST_WHITE:
            return False
        lit = np.clip(pattern.colours[white] * light[:-1] + light[-1], 0, 255)
        seen = self._beside[white] + mean
        is_white = seen.min(axis=1).mean() > WHITE / 2
        kept, coloured = (median(np.ptp(one, axis=1)) for one in (seen, lit))
        return bool(is_white and kept <= NEARLY and coloured > kept + COLOURED)

    def _aligned(self, place: Place, blur: Blur, posed: bool, settled: float, sharp: bool) -> tuple[Matrix, Plane]:
        """Align the place and fit its light, in turns; return the motion and how far the pixels are trusted."""
        motion = moved = np.zeros(4)
        softened = False
        trust = self._counts
        motions = Motions(self.weights > 0, len(self._mixture) - 1, posed)
        reach = np.array([1, 1, sum(self.shape) / 2, sum(self.shape) / 2])
        for step in range(STEPS):
            self.seen = blur(place.moved(motion))
            before, self._mixture = self._mixture, self._in_light(trust)
            self.predicted = self._as_seen(self.template)
            variance = self._varied(self._mixture)
            rounding = ROUNDING**2 * float(np.square(self._mixture[-1]).sum())
            self.variance = variance if variance > rounding else 0.0
            other = self._mixture - before
            changed = self._varied(other) + float(np.square(other[-1]).sum())
            still = np.abs(moved) @ reach < settled and not softened
            ended = step > TRUSTING and still and changed < NONE * self.variance
            if step == STEPS - 1 or ended or not self.variance > 0:
                break
            residual = self._residual()
            squared = squares(residual)
            moved, softer = motions.explaining(self.predicted, residual, trust)
            motion = np.clip(motion + moved, -FARTHEST, FARTHEST)
            softer = 0.0 if sharp else min(max(self._softer + softer, SHARPEST), SOFTEST)
            softened = abs(softer - self._softer) > SOFTER
            if softened:
                self._soften(blur(self._deviations, softer), softer)
            if step >= TRUSTING - 1:  # pixels that something else covers are trusted ever less
                usual = max(0.06 * self.variance, 2 * median(squared))
                trust = np.asarray(self._counts / np.square(1 + squared.astype(np.float64) / usual), dtype=np.float32)
            elif step and squared.max() < NONE * self.variance:
                break
        return motion, trust

    def _in_light(self, trust: Plane) -> Matrix:
        """Return the mixture of the template's colours, and a level, that is nearest to what is seen."""
        channels, terms = self._given.shape[1], self._terms
        weighted = terms * trust
        products, sums = weighted @ terms.T, weighted @ self._flat(self.seen)
        # A template of few colours leaves the mixture open: the nearest to one gain of all channels is taken.
        energies = (products.diagonal() - np.square(products[-1]) / products[-1, -1])[:-1]
        common = sums[:-1].diagonal() - products[-1, :-1] * sums[-1] / products[-1, -1]
        self._sign = float(common.sum() / energies.sum()) if energies.sum() > 0 else 0.0
        self._slopes = common / np.where(energies > 0, energies, 1.0)
        alike = np.vstack([self._sign * np.eye(channels), np.zeros(channels)])
        return np.asarray(np.linalg.solve(products + self._ridge, sums + self._ridge @ alike))

    def _varied(self, mixture: Matrix) -> float:
        """Return the variance of the template in a mixture of its colours."""
        return float((mixture[:-1].T @ self._about @ mixture[:-1]).trace())

    def _residual(self) -> Plane:
        return self._flat(self.seen) - self._flat(self.predicted)

    @property
    def contrast(self) -> float:
        """Standard deviation of what is predicted over that of the template, negative for its negative."""
        spread = float(self._about.trace())
        return math.copysign(math.sqrt(self.variance / spread), self._sign) if spread > 0 else 0.0

    @property
    def gain(self) -> tuple[float, ...]:
        """For each channel the slope of its values against those of the template, the contrast if it has but one."""
        varies = np.ptp(self._given, axis=0) > 0
        return tuple(float(slope) if own else self.contrast for slope, own in zip(self._slopes, varies, strict=True))

    @property
    def is_blurred(self) -> bool:
        """Whether the place is more or less sharp than the template."""
        return abs(self._softer) > SOFTER

    @property
    def explained(self) -> float:
        """Share of the variance of the place that the template explains."""
        return explained(self._flat(self.seen), self._flat(self.predicted), self._counts)

    @property
    def explained_beyond(self) -> float:
        """The same share of what no slope or bend explains: those are in every shading."""
        some = np.s_[:: max(1, self._counts.size // SAMPLED)]
        counts, seen, predicted = (self._flat(one)[some] for one in (self.weights, self.seen, self.predicted))
        down, right = (
            self._flat(np.broadcast_to((at / side - 0.5).astype(np.float32), self.shape))[some]
            for at, side in zip(np.ogrid[: self.shape[0], : self.shape[1]], self.shape, strict=True)
        )
        terms = np.stack([np.ones_like(down), down, right, down * down, down * right, right * right]).astype(np.float64)
        weighted = terms * counts
        products = weighted @ terms.T + 1e-9 * np.eye(len(terms))
        seen, predicted = (one - terms.T @ np.linalg.solve(products, weighted @ one) for one in (seen, predicted))
        return explained(seen, predicted, counts)

    def explained_in(self, blocks: npt.NDArray[np.bool_]) -> float:
        """Return the same share of these blocks alone."""
        counts = self._flat((self.over(blocks) & self.counted).astype(np.float32))
        return explained(self._flat(self.seen), self._flat(self.predicted), counts) if counts.any() else 0.0

    def has_another_mark(self) -> bool:
        """Return whether some mark differs by more than a move by a part of a pixel, or a blur, of its own explains."""
        left = self._flat(self.seen - self.predicted)
        exact = squares(left).max() < NONE * self.variance
        return not exact and another_mark(self.seen, self.predicted, self.weights)

    def grain_in(self, blocks: npt.NDArray[np.bool_]) -> float:
        """Return the mean square of the grain of the place in these blocks, over that of what remains there.

        Grain is what no plane through nine pixels holds: noise has 8 times as much of it as of what a blur leaves.
        """
        where = self.over(blocks) & self.counted
        grain = cv2.filter2D(self._beside, -1, GRAIN).reshape(self._beside.shape)[where]
        remains = (self.seen - self.predicted)[where]
        return float(np.square(grain).sum() / max(float(np.square(remains).sum()), 1e-12))

    def over(self, blocks: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return which pixels are in these blocks."""
        inside = cv2.resize(blocks.astype(np.uint8), self.shape[::-1], interpolation=cv2.INTER_NEAREST)
        return np.asarray(inside > 0)

    @property
    def counted(self) -> npt.NDArray[np.bool_]:
        """The pixels that can disagree."""
        return np.asarray(self.weights >= COUNTS)

    def _flat(self, plane: Plane) -> Plane:
        """Return the pixels of a plane that count, one after another."""
        return np.asarray(plane.reshape(self.weights.size, *plane.shape[2:])[self._on])

    def _tones(self, trust: Matrix) -> list[tuple[float, Matrix] | None]:
        """Return for each channel a curve of the predicted tones over their spread, if it rises steadily; and that.

        A screen's or camera's gamma is one. What a sibling has elsewhere is none.
        """
        curves: list[tuple[float, Matrix] | None] = []
        predicted, seen = (self._flat(one).astype(np.float64) for one in (self.predicted, self.seen))
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
            rises = np.diff(np.polyval(curve, ends))
            if rises.min() > FLATTEST * rises.max():
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

    @property
    def sharp(self) -> tuple[Plane, Plane]:
        """What is predicted and what is seen, neither blurred."""
        return self._as_seen(self._as_soft()), self._beside

    def _as_soft(self) -> Plane:
        """Return the template as soft as the place."""
        if self._softer <= SOFTER:
            return self._deviations
        return Blur(self._known).by(self._deviations, math.sqrt(self._softer))

    def differences(self, *, sharp: bool = False) -> Plane:
        """Return what no displacement of edges by a part of a pixel explains, squared, summed over channels.

        Of the blurred images, or of the sharp ones.
        """
        predicted, seen = self.predicted, self.seen
        if sharp:
            predicted, seen = self.sharp
        least = np.minimum(beyond(seen, predicted), beyond(predicted, seen))
        return np.asarray(np.square(least).sum(axis=2) * self.counted)

    def averaged(self, plane: Plane | None) -> Plane:
        """Return the mean over each block of what counts, as a share of the variance; None: the share that counts."""
        inside = averaged(self.counted, blocks_of(self.shape))
        if plane is None:
            return inside
        total = averaged(plane * self.counted, blocks_of(self.shape))
        return np.asarray(total / np.maximum(inside, 1e-6) / self.variance, dtype=np.float32)

    def disagrees(self, counts: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return the blocks that differ by more than noise, which is in all blocks alike or as they are steep.

        What is beside the template may be mixed into its rim.
        """
        disagrees = self._differing(counts)
        if not disagrees.any():
            return disagrees
        rim = Rim(np.cbrt(self.own_weights))
        if (averaged(rim.reached, disagrees.shape) < LEAST_MIXED)[disagrees].any():
            return disagrees
        around = self._place().moved(self.motion, AROUND)
        mixed = self.predicted + rim.mixed_in(around, self.sharp[0], self.seen - self.predicted, Blur(self.weights))
        left, remains = (self.averaged(np.square(self.seen - one).sum(axis=2)) for one in (self.predicted, mixed))
        if (remains > OF_MOVED * left)[disagrees].any():
            return disagrees
        self.predicted = mixed
        return self._differing(counts)

    def _differing(self, counts: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return the blocks that differ by more than noise.

        None does if all agree once the parts there are moved a little: drawn on whole pixels, a mark and its frame
        are.
        """
        if not counts.any():
            return counts
        left = self.averaged(np.square(self.seen - self.predicted).sum(axis=2))
        steep = self.averaged(sum(np.square(one).sum(axis=2) for one in gradient(self.predicted))) + STEADY
        # In flat blocks what is left is no more than noise, however little that is beside how steep they are.
        shares = [median((left / steep)[some]) for some in (counts, counts & (steep > 2 * STEADY)) if some.any()]
        noise = np.maximum(median(left[counts]), steep * min(*shares, OF_STEEP))
        behind = THROUGH * self.averaged(self.shown_through)
        most = np.minimum(DIFFERENT + TIMES * noise, MOST) + behind
        disagrees = np.asarray((left > most) & counts & (self.averaged(self.differences()) > DISPLACED))
        if not disagrees.any():
            most = np.maximum(FAINT, SHIFTED * steep) + EXACT * noise + behind
            disagrees = np.asarray((left > most) & counts)
        if not disagrees.any():
            return disagrees
        # Most cannot: what a pixel's move changes is bounded by how steep a block is, and to try all moves takes long.
        least = np.sqrt(left[disagrees]) - MOVES_AT_MOST * np.sqrt(steep[disagrees])
        if (np.square(np.maximum(least, 0)) > most[disagrees]).any():
            return disagrees
        moved = self.averaged(np.square(self.seen - self._with_parts_moved(disagrees)).sum(axis=2))
        # Where a mark is another one, a move explains a little of it as well.
        still = np.asarray((moved > np.minimum(most, OF_MOVED * left)) & disagrees)
        return disagrees if still.any() else still

    def _with_parts_moved(self, blocks: npt.NDArray[np.bool_]) -> Plane:
        """Return what is predicted, all of it moved by up to a pixel so that these blocks fit best."""
        rows, cols = self.shape
        where = self.over(blocks) & self.counted
        best, least = self.predicted, math.inf
        for down, right in product(PARTED, repeat=2):
            matrix = np.array([[1.0, 0.0, right], [0.0, 1.0, down]])
            moved = cv2.warpAffine(self.predicted, matrix, (cols, rows), borderMode=cv2.BORDER_REPLICATE)
            moved = np.asarray(moved, dtype=np.float32).reshape(self.predicted.shape)
            left = float(np.square((self.seen - moved)[where]).sum())
            if left < least:
                best, least = moved, left
        return best

    def structure(self) -> Plane:
        """Return the energy of each block of the template about its own mean."""
        whole, weights = Blur(self.own_weights)(self._deviations), self.own_weights[:, :, np.newaxis]
        share = averaged(self.own_weights, blocks_of(self.shape))
        means, squares = (
            [
                averaged(one, blocks_of(self.shape)) / np.maximum(share, 1e-6)
                for one in np.moveaxis(weights * power, 2, 0)
            ]
            for power in (whole, np.square(whole))
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


def best_fit(image: Image, pattern: Pattern, row: int, col: int, posed: bool, settled: float = SETTLED) -> Fit:
    """Return the fit of a place with its blur, or without one if the other tones of a gamma explain more."""
    fit = Fit(image, pattern, row, col, posed, settled)
    if not fit.is_blurred:
        return fit
    sharp = Fit(image, pattern, row, col, posed, settled, sharp=True)
    return max(fit, sharp, key=lambda one: one.explained)


def _recoloured(
    given: Matrix, predicted: Matrix, seen: Matrix, trust: Matrix, dtype: np.dtype[Any]
) -> tuple[float, Matrix | None]:
    """Return how far the fitted colours are from a gain of each channel and an offset of all, as a share of variance.

    Or from a gain of all and an offset of each, as under a tint. And the gains and the offset, None of a single channel
    or under a tint.

    A light or a camera multiplies channels; haze and exposure add to all. Pixels that the image clips could be
    brighter, and do not count in the fit.
    """
    channels = given.shape[1]
    if channels == 1:
        return 0.0, None
    top = float(np.iinfo(dtype).max) if dtype.kind == "u" else math.inf
    products, sums = np.zeros((channels + 1, channels + 1)), np.zeros(channels + 1)
    for one in range(channels):
        weights = trust * (seen[:, one] < ALMOST_WHITE * top)
        terms = np.column_stack([given[:, one], np.ones(len(given))])
        at = np.ix_([one, channels], [one, channels])
        products[at] += terms.T @ (terms * weights[:, np.newaxis])
        sums[[one, channels]] += terms.T @ (weights * predicted[:, one])
    products[np.diag_indices(channels + 1)] += 1e-12 * (1 + np.trace(products))
    light = np.linalg.solve(products, sums)
    lit = np.minimum(given * light[:-1] + light[-1], top)
    away = np.square(np.minimum(predicted, top) - lit).sum(axis=1)
    shares = trust / trust.sum()
    own, other = given - shares @ given, predicted - shares @ predicted
    gain = float((shares @ (own * other)).sum() / max(float((shares @ np.square(own)).sum()), 1e-12))
    left = float((shares @ np.square(other - gain * own)).sum())
    varies = max(float(predicted.var(axis=0).sum()), 1e-12)
    share = float(shares @ away) / varies
    return (left / varies, None) if TINTED[0] <= gain <= TINTED[1] and left < TINT * share * varies else (share, light)


def averaged(plane: npt.NDArray[Any], shape: tuple[int, int]) -> Plane:
    """Return the means of a plane over blocks, so many along its sides."""
    smaller = cv2.resize(np.ascontiguousarray(plane, dtype=np.float32), shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(smaller, dtype=np.float32).reshape(shape)
