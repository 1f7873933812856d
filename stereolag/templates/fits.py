"""A template fitted to a place of an image: motion below a pixel, blur, light and colours; residuals block by block."""

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
from stereolag.templates.aligning import (
    MAX_MOTION,
    PATCH_MARGIN_PX,
    Matrix,
    MotionSolver,
    Patch,
    Plane,
    squared_gradient,
)
from stereolag.templates.differences import excess, explained_variance, has_another_mark, squares
from stereolag.templates.patterns import FULL_WEIGHT, Pattern
from stereolag.templates.softening import MIN_BLEED, BackgroundBleed, Blur

MAX_STEPS = 8
"""Steps of the alignment."""

UNWEIGHTED_STEPS = 3
"""Steps before pixels that disagree are given less weight."""

MOTION_TOLERANCE_PX = 0.002
"""The alignment ends, unless asked otherwise, once a step moves no corner by more."""

NO_DIFFERENCE = 1e-6
"""Squared difference that counts as none, as a share of the variance."""

TONE_CURVE_DEGREE = 3
"""Degree of the polynomial fitted to the tones."""

MIN_SLOPE_RATIO = 0.1
"""Least slope of a tone curve over its greatest.

Measured: from 0.18 under gammas of 0.55 to 1.8; 0.04 where a curve made one round spot of another, half as wide.
"""

BLUR_VARIANCE_LIMITS = (-0.4, 1.0)
"""Limits of the squared blur of a place minus that of the template, px²; negative where the place is sharper."""

MIN_BLUR_CHANGE = 0.02
"""Least change of the squared blur that is applied, px²."""

RIM_SIGMAS = 1.5
"""Width of the rim into which a blur mixes pixels from outside the template, in sigmas of the blur."""

BLOCKS_PER_SIDE = 7
"""Blocks along the side of a square template."""

MIN_BLOCK_PX = 5
"""Least side of a block; a small template has fewer blocks."""

MIN_BLOCK_DIFFERENCE = 0.06
"""Least mean squared difference of a block that disagrees, above the noise, as a share of the template's variance.

Measured without noise: up to 0.05 where the template is, from 0.21 where a sibling is.
"""

NOISE_FACTOR = 2.5
"""Factor of the noise in the median block, beyond which a block differs."""

MAX_GRADIENT_NOISE = 0.4
"""Largest squared difference over squared gradient of the median block that is taken for noise.

Measured: up to 0.3 where the template is, 1.1 where most blocks show something else.
"""

MIN_UNDISPLACED_DIFFERENCE = 0.003
"""Least part of a block's difference that no displacement by a fraction of a pixel explains."""

MIN_FAINT_DIFFERENCE = 0.02
"""Least difference of a faint block that disagrees where all others fit exactly.

Measured: a word in faint letters beside clear ones has 0.03 to 0.06, another suit of a card, 13 px high, 0.05 to 0.17.
"""

HALF_PIXEL_DIFFERENCE = 0.25
"""Squared difference over squared gradient when a block is moved by half a pixel."""

FAINT_NOISE_FACTOR = 10.0
"""As :data:`NOISE_FACTOR`, for faint blocks."""

BACKGROUND_FACTOR = 2.0
"""Difference allowed where the background shows through, over the variance that it contributes if it varies as much as
the place."""

MAX_MOVE_EFFECT = 3.0
"""Largest change of a block moved by a pixel each way, in roots of its mean squared gradient."""

MAX_REMAINING = 0.5
"""Largest share of a difference that remains where a move or the background explains it."""

GRADIENT_FLOOR = 0.01
"""Added to the squared gradient of a block, as a share of the template's variance."""

MAX_AGREEING_DIFFERENCE = 0.3
"""Largest difference of a block that agrees, however noisy, as a share of the template's variance."""

MIN_JUDGED_WEIGHT = 0.5
"""Least weight of a pixel that can disagree: through others the background shows."""

MIN_JUDGED_SHARE = 0.3
"""Least share of such pixels in a block that can disagree."""

MIN_OPAQUE_SHARE = 0.6
"""Least share of the pixels of an opaque template through which no background shows."""

CLIPPED_SHARE = 0.985
"""Share of an integer type's largest value from which a pixel is taken for clipped."""


def blocks_of(shape: tuple[int, int]) -> tuple[int, int]:
    """Return rows and columns of the blocks of a template."""
    side = max(MIN_BLOCK_PX, math.sqrt(shape[0] * shape[1]) / BLOCKS_PER_SIDE)
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
    refine_pose
        Whether size and angle are fitted as well as the shift.
    tolerance_px
        The alignment ends once a step moves no corner by more.
    sharp
        Whether the place is as sharp as the template; otherwise its blur is fitted too.

    Attributes
    ----------
    observed, predicted
        (rows, cols, channels), the blurred image at the place and its prediction from the template, both minus the
        template's mean.
    weights, template_weights
        (rows, cols), the weight of each pixel, 0 outside the image; and as in the pattern.
    variance
        Variance of the prediction.
    motion
        Down and right, px, logarithm of the size, and angle, radians.
    colour_change
        Distance of the fitted colours from the effect of a light, as a share of the variance: :func:`_colour_change`.
    background
        (rows, cols), the variance that the background contributes if it varies as much as the place.
    """

    def __init__(
        self,
        image: Image,
        pattern: Pattern,
        row: int,
        col: int,
        refine_pose: bool,
        tolerance_px: float = MOTION_TOLERANCE_PX,
        *,
        sharp: bool = False,
    ) -> None:
        self.template_weights = pattern.weights.astype(np.float32)
        self.weights = _inside(self.template_weights, image, row, col)
        self.shape = pattern.shape
        valid = self.weights > 0
        self._valid = slice(None) if valid.all() else valid.ravel()
        # A template that was resized has a rim of lower weight.
        self.is_opaque = bool((self.template_weights[valid] >= FULL_WEIGHT).mean() >= MIN_OPAQUE_SHARE)
        self._deviations = np.moveaxis(pattern.deviations, 0, 2).astype(np.float32)
        self._weights_in_image, blur = self.weights, Blur(self.weights)
        self._flat_weights = self._flat(self.weights)
        self._set_template(blur(self._deviations), 0.0)
        # Minus the template's mean, the values of a place on any pedestal fit into float32.
        first = np.nonzero(valid)[0][0], np.nonzero(valid)[1][0]
        mean = pattern.colours[first].astype(np.float64) - pattern.deviations[:, first[0], first[1]]
        # Made again when needed: its planes are large, and two fits are compared.
        self._patch = partial(Patch, image, mean, row, col, self.shape)
        patch = self._patch()
        channels = self._template_pixels.shape[1]
        self._colour_map = np.zeros((channels + 1, channels))
        self._tone_curves: list[tuple[float, Matrix] | None] = [None] * channels
        self.observed = self.predicted = self.template
        self.variance = 0.0
        self.motion, robust_weights = self._aligned(patch, blur, refine_pose, tolerance_px, sharp)
        rim = round(RIM_SIGMAS * math.sqrt(max(self._blur_variance, 0.0)))
        inner = np.s_[rim:-rim, rim:-rim]
        if rim and self.weights[inner].sum() > MIN_BLOCK_PX**2 and self._energy(inner) > self._energy(np.s_[:]) / 2:
            blur, robust_weights = self._without_rim(rim, patch, robust_weights)
        self._sharp_patch = patch.warped(self.motion)
        template, predicted, observed = (
            self._flat(blur.evened(plane)).astype(np.float64) + mean
            for plane in (self.template, self.predicted, self.observed)
        )
        trusted = (robust_weights * (self._flat_weights >= MIN_JUDGED_WEIGHT)).astype(np.float64)
        self.colour_change, light = _colour_change(template, predicted, observed, trusted, image.dtype)
        if light is not None and image.dtype == np.uint8 and self._keeps_white(pattern, mean, light):
            self.colour_change = 1.0
        if squares(self._residual()).max() >= NO_DIFFERENCE * self.variance:
            drawn, shown = (self._flat(plane).astype(np.float64).T for plane in (self.predicted, self.observed))
            fit_tones = partial(_tone_curve, weights=robust_weights.astype(np.float64))
            self._tone_curves = [*map(fit_tones, drawn, shown)]
            self.predicted = self._rendered(self.template)
        is_translucent = (self.template_weights[valid] < 1).any()
        behind = float(self._sharp_patch.var(axis=(0, 1)).sum()) if is_translucent else 0.0
        self.background = behind * np.square(1 - np.cbrt(self.weights))

    def _set_template(self, template: Plane, blur_variance: float) -> None:
        """Fit this blurred template from now on; the place is blurrier by `blur_variance`, px²."""
        self._blur_variance = blur_variance
        self.template = template
        self._template_pixels = self._flat(self.template)
        flags = cv2.COVAR_NORMAL | cv2.COVAR_ROWS | cv2.COVAR_SCALE
        self._covariance = cv2.calcCovarMatrix(self._template_pixels, None, flags, ctype=cv2.CV_64F)[0]  # type: ignore[call-overload]
        self._terms = np.vstack([self._template_pixels.T, np.ones(len(self._template_pixels))]).astype(np.float64)
        # Where only a flat part of the template is inside the image, its level alone keeps the colour map solvable.
        level = float(np.square(self._template_pixels.mean(axis=0, dtype=np.float64)).sum())
        ridge = (1e-4 * float(self._covariance.trace()) + 1e-9 * level) or 1.0
        self._ridge = np.diag([ridge * len(self._template_pixels)] * self._template_pixels.shape[1] + [0.0])

    def _energy(self, region: Any) -> float:
        """Return the energy of the template in a region."""
        part = self._deviations[region]
        return float(np.einsum("ijk,ijk,ij", part, part, self.weights[region]))

    def _without_rim(self, rim: int, patch: Patch, robust_weights: Plane) -> tuple[Blur, Plane]:
        """Fit the light without a rim of so many px, mixed with what is outside; return blur and robust weights."""
        inner = np.zeros_like(self.weights)
        inner[rim:-rim, rim:-rim] = 1
        self.weights = self.weights * inner
        self._flat_weights, robust_weights = self._flat(self.weights), robust_weights * self._flat(inner)
        blur = Blur(self.weights)
        # The template's own rim is blurred into the rest.
        self._set_template(blur(self.soft_template), self._blur_variance)
        self.observed = blur(patch.warped(self.motion))
        self._colour_map = self._fitted_colour_map(robust_weights)
        self.predicted = self._rendered(self.template)
        return blur, robust_weights

    def _keeps_white(self, pattern: Pattern, mean: Matrix, light: Matrix) -> bool:
        """Return whether white is seen as white, though the gains and the offset of a light would colour it.

        A few letters on a button have little weight, but show that its other colour is not due to the light. All limits
        are grey levels of 255; chroma is the difference between the channels of a pixel.
        """
        white = (pattern.colours.min(axis=2) >= 200) & (np.ptp(pattern.colours, axis=2) <= 12) & self.judged
        if white.sum() < 8:  # pixels
            return False
        lit = np.clip(pattern.colours[white] * light[:-1] + light[-1], 0, 255)
        observed = self._sharp_patch[white] + mean
        is_bright = observed.min(axis=1).mean() > 100
        observed_chroma, lit_chroma = (median(np.ptp(pixels, axis=1)) for pixels in (observed, lit))
        return bool(is_bright and observed_chroma <= 20 and lit_chroma > observed_chroma + 25)

    def _aligned(
        self, patch: Patch, blur: Blur, refine_pose: bool, tolerance_px: float, sharp: bool
    ) -> tuple[Matrix, Plane]:
        """Fit motion, blur and light in turns; return the motion and the robust weights of the pixels."""
        motion = step_motion = np.zeros(4)
        blur_changed = False
        robust_weights = self._flat_weights
        solver = MotionSolver(self.weights > 0, len(self._colour_map) - 1, refine_pose)
        reach = np.array([1, 1, sum(self.shape) / 2, sum(self.shape) / 2])
        for step in range(MAX_STEPS):
            self.observed = blur(patch.warped(motion))
            before, self._colour_map = self._colour_map, self._fitted_colour_map(robust_weights)
            self.predicted = self._rendered(self.template)
            variance = self._mapped_variance(self._colour_map)
            rounding = float(np.finfo(np.float32).eps) ** 2 * float(np.square(self._colour_map[-1]).sum())
            self.variance = variance if variance > rounding else 0.0
            change = self._colour_map - before
            changed = self._mapped_variance(change) + float(np.square(change[-1]).sum())
            still = np.abs(step_motion) @ reach < tolerance_px and not blur_changed
            ended = step > UNWEIGHTED_STEPS and still and changed < NO_DIFFERENCE * self.variance
            if step == MAX_STEPS - 1 or ended or not self.variance > 0:
                break
            residual = self._residual()
            squared = squares(residual)
            step_motion, blur_step = solver.step(self.predicted, residual, robust_weights)
            motion = np.clip(motion + step_motion, -MAX_MOTION, MAX_MOTION)
            least, most = BLUR_VARIANCE_LIMITS
            blur_variance = 0.0 if sharp else min(max(self._blur_variance + blur_step, least), most)
            blur_changed = abs(blur_variance - self._blur_variance) > MIN_BLUR_CHANGE
            if blur_changed:
                self._set_template(blur(self._deviations, blur_variance), blur_variance)
            if step >= UNWEIGHTED_STEPS - 1:  # pixels covered by something else lose weight from step to step
                scale = max(0.06 * self.variance, 2 * median(squared))
                factors = np.square(1 + squared.astype(np.float64) / scale)
                robust_weights = np.asarray(self._flat_weights / factors, dtype=np.float32)
            elif step and squared.max() < NO_DIFFERENCE * self.variance:
                break
        return motion, robust_weights

    def _fitted_colour_map(self, weights: Plane) -> Matrix:
        """Return the affine map of the template's colours, (channels + 1, channels), nearest to the image."""
        channels, terms = self._template_pixels.shape[1], self._terms
        weighted = terms * weights
        products, sums = weighted @ terms.T, weighted @ self._flat(self.observed)
        # A template of few colours leaves the map undetermined: the nearest to one gain of all channels is taken.
        energies = (products.diagonal() - np.square(products[-1]) / products[-1, -1])[:-1]
        common = sums[:-1].diagonal() - products[-1, :-1] * sums[-1] / products[-1, -1]
        self._common_gain = float(common.sum() / energies.sum()) if energies.sum() > 0 else 0.0
        self._gains = common / np.where(energies > 0, energies, 1.0)
        one_gain = np.vstack([self._common_gain * np.eye(channels), np.zeros(channels)])
        return np.asarray(np.linalg.solve(products + self._ridge, sums + self._ridge @ one_gain))

    def _mapped_variance(self, colour_map: Matrix) -> float:
        """Return the variance of the template under a map of its colours."""
        return float((colour_map[:-1].T @ self._covariance @ colour_map[:-1]).trace())

    def _residual(self) -> Plane:
        return self._flat(self.observed) - self._flat(self.predicted)

    @property
    def contrast(self) -> float:
        """Standard deviation of the prediction over that of the template, negative for its negative."""
        variance = float(self._covariance.trace())
        return math.copysign(math.sqrt(self.variance / variance), self._common_gain) if variance > 0 else 0.0

    @property
    def gain(self) -> tuple[float, ...]:
        """For each channel the slope of its values against the template's, or the contrast if those are constant."""
        varies = np.ptp(self._template_pixels, axis=0) > 0
        return tuple(float(gain) if own else self.contrast for gain, own in zip(self._gains, varies, strict=True))

    @property
    def is_blurred(self) -> bool:
        """Whether the place is blurrier or sharper than the template."""
        return abs(self._blur_variance) > MIN_BLUR_CHANGE

    @property
    def explained(self) -> float:
        """Share of the variance of the place that the template explains."""
        return explained_variance(self._flat(self.observed), self._flat(self.predicted), self._flat_weights)

    @property
    def explained_detail(self) -> float:
        """The same share without a quadratic surface, which is in every shading."""
        every = np.s_[:: max(1, self._flat_weights.size // 2**16)]  # that many pixels determine a surface
        weights, observed, predicted = (
            self._flat(plane)[every] for plane in (self.weights, self.observed, self.predicted)
        )
        down, right = (
            self._flat(np.broadcast_to((at / side - 0.5).astype(np.float32), self.shape))[every]
            for at, side in zip(np.ogrid[: self.shape[0], : self.shape[1]], self.shape, strict=True)
        )
        terms = np.stack([np.ones_like(down), down, right, down * down, down * right, right * right]).astype(np.float64)
        weighted = terms * weights
        products = weighted @ terms.T + 1e-9 * np.eye(len(terms))
        observed, predicted = (
            pixels - terms.T @ np.linalg.solve(products, weighted @ pixels) for pixels in (observed, predicted)
        )
        return explained_variance(observed, predicted, weights)

    def explained_in(self, blocks: npt.NDArray[np.bool_]) -> float:
        """Return the same share in these blocks alone."""
        weights = self._flat((self.pixels_of(blocks) & self.judged).astype(np.float32))
        return (
            explained_variance(self._flat(self.observed), self._flat(self.predicted), weights) if weights.any() else 0.0
        )

    def has_another_mark(self) -> bool:
        """Return whether a mark differs by more than a shift by a fraction of a pixel, or a blur, of it explains."""
        exact = squares(self._flat(self.observed - self.predicted)).max() < NO_DIFFERENCE * self.variance
        return not exact and has_another_mark(self.observed, self.predicted, self.weights)

    def grain_in(self, blocks: npt.NDArray[np.bool_]) -> float:
        """Return the energy of the grain of the place in some blocks over that of the residual there.

        Grain is the residual from a plane through 3 × 3 pixels: noise has 8 times the energy left by the blur.
        """
        where = self.pixels_of(blocks) & self.judged
        kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32) / 6  # keeps the variance of noise
        grain = cv2.filter2D(self._sharp_patch, -1, kernel).reshape(self._sharp_patch.shape)[where]
        residual = (self.observed - self.predicted)[where]
        return float(np.square(grain).sum() / max(float(np.square(residual).sum()), 1e-12))

    def pixels_of(self, blocks: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return the mask of the pixels in some blocks."""
        return np.asarray(cv2.resize(blocks.astype(np.uint8), self.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0)

    @property
    def judged(self) -> npt.NDArray[np.bool_]:
        """The pixels that can disagree."""
        return np.asarray(self.weights >= MIN_JUDGED_WEIGHT)

    @property
    def judged_shares(self) -> Plane:
        """The share of pixels that can disagree in each block."""
        return block_means(self.judged, blocks_of(self.shape))

    def _flat(self, plane: Plane) -> Plane:
        """Return the valid pixels of a plane, one after another."""
        return np.asarray(plane.reshape(self.weights.size, *plane.shape[2:])[self._valid])

    def _rendered(self, plane: Plane) -> Plane:
        """Return colours of the template in the light of the place, 0 where the weight is 0."""
        colour_map = self._colour_map.astype(np.float32)
        lit = plane @ colour_map[:-1] + colour_map[-1]
        for channel, curve in enumerate(self._tone_curves):
            if curve is not None:
                scale, powers = curve
                lit[:, :, channel] = np.polyval(powers.astype(np.float32), lit[:, :, channel] / np.float32(scale))
        if not isinstance(self._valid, slice):
            lit[self.weights == 0] = 0
        return np.asarray(lit)

    @property
    def sharp(self) -> tuple[Plane, Plane]:
        """The prediction and the image at the place, neither blurred for the comparison."""
        return self._rendered(self.soft_template), self._sharp_patch

    @property
    def soft_template(self) -> Plane:
        """The template minus its mean, as blurred as the image at the place, but in its own light."""
        if self._blur_variance <= MIN_BLUR_CHANGE:
            return self._deviations
        return Blur(self._weights_in_image).by(self._deviations, math.sqrt(self._blur_variance))

    def squared_differences(self, *, sharp: bool = False) -> Plane:
        """Return the squared differences, summed over channels, that no displacement by part of a pixel explains.

        Of the blurred images, or of the sharp ones.
        """
        predicted, observed = self.sharp if sharp else (self.predicted, self.observed)
        least = np.minimum(excess(observed, predicted), excess(predicted, observed))
        return np.asarray(np.square(least).sum(axis=2) * self.judged)

    def _relative_means(self, plane: Plane) -> Plane:
        """Return the mean of a plane over the judged pixels of each block, as a share of the variance."""
        total = block_means(plane * self.judged, blocks_of(self.shape))
        return np.asarray(total / np.maximum(self.judged_shares, 1e-6) / self.variance, dtype=np.float32)

    def disagreeing(self, judged: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return which of the judged blocks differ by more than noise and background mixed into the rim explain."""
        disagreeing = self._differing(judged)
        if not disagreeing.any():
            return disagreeing
        bleed = BackgroundBleed(np.cbrt(self.template_weights))
        if (block_means(bleed.max_share, disagreeing.shape) < MIN_BLEED)[disagreeing].any():
            return disagreeing
        surroundings = self._patch().warped(self.motion, PATCH_MARGIN_PX)
        residual = self.observed - self.predicted
        mixed = self.predicted + bleed.change(surroundings, self.sharp[0], residual, Blur(self.weights))
        before, after = (
            self._relative_means(np.square(self.observed - plane).sum(axis=2)) for plane in (self.predicted, mixed)
        )
        if (after > MAX_REMAINING * before)[disagreeing].any():
            return disagreeing
        self.predicted = mixed
        return self._differing(judged)

    def _differing(self, judged: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return which of the judged blocks differ by more than noise; noise is uniform or grows with the gradient.

        None differs if all agree once the parts there are moved a little, as a mark and its frame are when each is
        drawn on whole pixels.
        """
        if not judged.any():
            return judged
        difference = self._relative_means(np.square(self.observed - self.predicted).sum(axis=2))
        steepness = self._relative_means(squared_gradient(self.predicted)) + GRADIENT_FLOOR
        # In flat blocks the difference is noise alone, however large it is beside their gradient.
        steep = judged & (steepness > 2 * GRADIENT_FLOOR)
        shares = [median((difference / steepness)[blocks]) for blocks in (judged, steep) if blocks.any()]
        noise = np.maximum(median(difference[judged]), steepness * min(*shares, MAX_GRADIENT_NOISE))
        behind = BACKGROUND_FACTOR * self._relative_means(self.background)
        limit = np.minimum(MIN_BLOCK_DIFFERENCE + NOISE_FACTOR * noise, MAX_AGREEING_DIFFERENCE) + behind
        undisplaced = self._relative_means(self.squared_differences())
        differing = np.asarray((difference > limit) & judged & (undisplaced > MIN_UNDISPLACED_DIFFERENCE))
        if not differing.any():
            limit = np.maximum(MIN_FAINT_DIFFERENCE, HALF_PIXEL_DIFFERENCE * steepness)
            limit = limit + FAINT_NOISE_FACTOR * noise + behind
            differing = np.asarray((difference > limit) & judged)
        if not differing.any():
            return differing
        # Trying all moves takes long; the gradient limits the change by a move of a pixel, mostly to less than needed.
        least = np.sqrt(difference[differing]) - MAX_MOVE_EFFECT * np.sqrt(steepness[differing])
        if (np.square(np.maximum(least, 0)) > limit[differing]).any():
            return differing
        moved = self._relative_means(np.square(self.observed - self._with_parts_moved(differing)).sum(axis=2))
        # A move explains a little of another mark as well.
        still = np.asarray((moved > np.minimum(limit, MAX_REMAINING * difference)) & differing)
        return differing if still.any() else still

    def _with_parts_moved(self, blocks: npt.NDArray[np.bool_]) -> Plane:
        """Return the prediction, all of it moved by up to a pixel so that these blocks fit best."""
        where = self.pixels_of(blocks) & self.judged

        def moved(down: float, right: float) -> Plane:
            matrix = np.array([[1.0, 0.0, right], [0.0, 1.0, down]])
            plane = cv2.warpAffine(self.predicted, matrix, self.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
            return np.asarray(plane, dtype=np.float32).reshape(self.predicted.shape)

        moves = (moved(*shift) for shift in product(np.linspace(-1, 1, 9), repeat=2))
        return min(moves, key=lambda plane: float(np.square((self.observed - plane)[where]).sum()))

    def block_energies(self) -> Plane:
        """Return the energy of each block of the template about its own mean, 0 where few pixels can disagree."""
        blurred, weights = Blur(self.template_weights)(self._deviations), self.template_weights[:, :, np.newaxis]
        share = block_means(self.template_weights, blocks_of(self.shape))
        means, mean_squares = (
            [
                block_means(plane, blocks_of(self.shape)) / np.maximum(share, 1e-6)
                for plane in np.moveaxis(weights * power, 2, 0)
            ]
            for power in (blurred, np.square(blurred))
        )
        energy = np.sum(mean_squares, axis=0) - np.square(means).sum(axis=0)
        is_judged = block_means(self.template_weights >= MIN_JUDGED_WEIGHT, blocks_of(self.shape)) > MIN_JUDGED_SHARE
        return np.asarray(np.where(is_judged, np.maximum(energy, 0) * share, 0))


def _inside(weights: Plane, image: Image, row: int, col: int) -> Plane:
    """Return the weights, 0 outside the image and within 2 px of pixels without data."""
    known = np.zeros(weights.shape, dtype=np.uint8)
    top, left = max(row, 0), max(col, 0)
    part = np.isfinite(image[top : max(row + weights.shape[0], 0), left : max(col + weights.shape[1], 0)]).all(axis=2)
    flags = np.asarray(part, dtype=np.uint8)
    eroded = flags if flags.all() else cv2.erode(flags, np.ones((5, 5), np.uint8))
    known[top - row :, left - col :][: part.shape[0], : part.shape[1]] = eroded
    return np.asarray(weights * known, dtype=np.float32)


def best_fit(
    image: Image, pattern: Pattern, row: int, col: int, refine_pose: bool, tolerance_px: float = MOTION_TOLERANCE_PX
) -> Fit:
    """Return the fit of a place with its blur, or without one if the tone curve of a gamma explains more."""
    fit = Fit(image, pattern, row, col, refine_pose, tolerance_px)
    if not fit.is_blurred:
        return fit
    sharp = Fit(image, pattern, row, col, refine_pose, tolerance_px, sharp=True)
    return max(fit, sharp, key=lambda candidate: candidate.explained)


def _tone_curve(predicted: Matrix, observed: Matrix, weights: Matrix) -> tuple[float, Matrix] | None:
    """Return the scale and polynomial that map predicted to observed tones of a channel; None unless it rises.

    The gamma of a screen or camera is such a curve; differences between siblings are not.
    """
    scale = float(predicted.std())
    if not scale > 1e-4 * np.abs(predicted).max():  # its powers cannot be told apart
        return None
    terms = np.vander(predicted / scale, TONE_CURVE_DEGREE + 1)
    weighted = terms * weights[:, np.newaxis]
    ridge = 1e-6 * weights.sum() * np.eye(TONE_CURVE_DEGREE + 1)
    curve = np.linalg.solve(terms.T @ weighted + ridge, weighted.T @ observed)
    slopes = np.diff(np.polyval(curve, np.linspace(predicted.min(), predicted.max(), 17) / scale))
    return (scale, curve) if slopes.min() > MIN_SLOPE_RATIO * slopes.max() else None


def _colour_change(
    template: Matrix, predicted: Matrix, observed: Matrix, weights: Matrix, dtype: np.dtype[Any]
) -> tuple[float, Matrix | None]:
    """Return the distance of the fitted colours from the effect of a light or a tint, as a share of the variance.

    A light or a camera multiplies each channel by a gain; haze and exposure add one offset to all. A tint is one gain
    of all channels and an offset of each. Clipped pixels could be brighter, and are left out of the fit.

    Returns
    -------
    The mean squared difference from the best light, or from a tint that leaves far less; and the gains of the light
    followed by its offset, None for a single channel and under a tint.
    """
    channels = template.shape[1]
    if channels == 1:
        return 0.0, None
    top = float(np.iinfo(dtype).max) if dtype.kind == "u" else math.inf
    products, sums = np.zeros((channels + 1, channels + 1)), np.zeros(channels + 1)
    for channel in range(channels):
        unclipped = weights * (observed[:, channel] < CLIPPED_SHARE * top)
        terms = np.column_stack([template[:, channel], np.ones(len(template))])
        at = np.ix_([channel, channels], [channel, channels])
        products[at] += terms.T @ (terms * unclipped[:, np.newaxis])
        sums[[channel, channels]] += terms.T @ (unclipped * predicted[:, channel])
    products[np.diag_indices(channels + 1)] += 1e-12 * (1 + np.trace(products))
    light = np.linalg.solve(products, sums)
    lit = np.minimum(template * light[:-1] + light[-1], top)
    error = np.square(np.minimum(predicted, top) - lit).sum(axis=1)
    shares = weights / weights.sum()
    given, fitted = template - shares @ template, predicted - shares @ predicted
    gain = float((shares @ (given * fitted)).sum() / max(float((shares @ np.square(given)).sum()), 1e-12))
    tint_error = float((shares @ np.square(fitted - gain * given)).sum())
    variance = max(float(predicted.var(axis=0).sum()), 1e-12)
    change = float(shares @ error) / variance
    if 0.4 <= gain <= 1 and tint_error < 0.1 * change * variance:
        return tint_error / variance, None
    return change, light


def block_means(plane: npt.NDArray[Any], shape: tuple[int, int]) -> Plane:
    """Return the means of a plane over (rows, cols) blocks."""
    smaller = cv2.resize(np.ascontiguousarray(plane, dtype=np.float32), shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(smaller, dtype=np.float32).reshape(shape)
