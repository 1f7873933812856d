"""How good a setting is on a pair: one figure, with truth or without."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from stereolag.estimates import Estimate, check_memory
from stereolag.inputs import Image, as_stereo_pair
from stereolag.settings import Settings
from stereolag.stereo.agreement import agreement, seen_from_the_right
from stereolag.stereo.estimates import ANSWER, fitting_pair
from stereolag.stereo.evaluation import evaluate
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.scaling import scaled_disparity, scaled_image, scaled_settings

FloatMap = npt.NDArray[np.float32]

RIGHT_WITHIN_PX = 2.0

AGREEMENT = 120
"""Bytes of a pixel while two maps are compared: both, the places to which they lead, and the patches there."""

JUDGEMENT = 80
"""Bytes of a pixel while a map is compared with the truth, in float64."""

AGREEMENT_SECONDS = 2e-7
"""Seconds a pixel to compare two maps, or one with the truth."""

SCALES = (1.0, 0.75, 0.5, 0.35, 0.25)
"""Sizes of a bench, full size first."""


def changed(matcher: StereoMatcher, changes: Mapping[str, object]) -> StereoMatcher:
    """Return the matcher with some settings changed and everything validated anew.

    Parameters
    ----------
    matcher
        The settings to start from.
    changes
        {name: value}; a name with dots reaches into a setting that has settings of its own: "search.vertical".

    Raises
    ------
    ValueError
        A name that does not exist or a value that is not allowed.
    """
    document = matcher.model_dump()
    for name, value in changes.items():
        setting(matcher, name)
        *path, last = name.split(".")
        holder = document
        for key in path:
            holder = holder[key]
        holder[last] = value
    return type(matcher).model_validate(document)


def setting(matcher: StereoMatcher, name: str) -> Any:
    """Return the value of a setting, named as in :func:`changed`.

    Raises
    ------
    ValueError
        A name that does not exist.
    """
    value: Any = matcher
    for part in name.split("."):
        if not isinstance(value, Settings) or part not in type(value).model_fields:
            raise ValueError(f"{type(matcher).__name__} has no setting {name!r}.")
        value = getattr(value, part)
    return value


@dataclass(frozen=True, eq=False)
class Bench:
    """A pair on which settings are tried, made smaller where trying takes too long in full.

    Attributes
    ----------
    left, right
        The images at their reduced size.
    truth
        (H, W) at that size, but in px of full size; None where unknown.
    scale
        Reduced size over full size.
    """

    left: Image
    right: Image
    truth: FloatMap | None
    scale: float

    @classmethod
    def of(
        cls, left: npt.ArrayLike, right: npt.ArrayLike, truth: npt.ArrayLike | None = None, *, scale: float = 1.0
    ) -> Bench:
        """Return the bench of a pair, `scale` times its size.

        Raises
        ------
        ValueError
            Images or a truth that do not fit together, or a scale that is not above 0 to 1.
        """
        images = as_stereo_pair(left, right)
        known = None if truth is None else np.asarray(truth, dtype=np.float32)
        if known is not None and known.shape != images[0].shape[:2]:
            raise ValueError(
                f"truth has shape {known.shape} and the images {images[0].shape[:2]}; both must be the same."
            )
        if scale == 1:
            return cls(*images, known, 1.0)
        if known is not None:
            known = scaled_disparity(known, scale) / np.float32(scale)
        return cls(scaled_image(images[0], scale), scaled_image(images[1], scale), known, scale)

    def estimate(self, matcher: StereoMatcher) -> Estimate:
        """Return what :meth:`merit` will take.

        Without truth the pair is matched twice, and the first map waits for the second.
        """
        return self._estimate(matcher, self.left.shape)

    def _estimate(self, matcher: StereoMatcher, shape: tuple[int, ...]) -> Estimate:
        fitting = matcher if self.scale == 1 else scaled_settings(matcher, self.scale)
        once = fitting.estimate(shape, self.left.dtype)
        pixels, judged = shape[0] * shape[1], AGREEMENT_SECONDS * shape[0] * shape[1]
        if self.truth is not None:
            return Estimate(max(once.memory, (ANSWER + JUDGEMENT) * pixels), once.seconds + judged)
        mirrored = 2 * int(np.prod(shape)) * self.left.dtype.itemsize
        memory = max(once.memory + ANSWER * pixels, AGREEMENT * pixels) + mirrored
        return Estimate(memory, 2 * once.seconds + judged)

    def merit(self, matcher: StereoMatcher) -> tuple[float, FloatMap]:
        """Return how good settings are, 0..1 and higher is better, and their disparity map.

        With truth: the share of its pixels measured within 2 px, missing ones counted as wrong. Without: the
        left-right-consistent photometric agreement.

        Parameters
        ----------
        matcher
            Settings meant for the full size.

        Returns
        -------
        merit
            Never NaN.
        disparity
            At the size of the bench, in px of full size.

        Raises
        ------
        ValueError
            Settings that do not fit the images, or that need more memory than one job may take.
        """
        check_memory(
            self.estimate(matcher),
            partial(
                fitting_pair, shape=self.left.shape, of_shape=partial(self._estimate, matcher), of_disparities=None
            ),
        )
        fitting = matcher if self.scale == 1 else scaled_settings(matcher, self.scale)
        result = fitting.compute(self.left, self.right)
        disparity = result.disparity / np.float32(self.scale)
        if self.truth is not None:
            judged = evaluate(disparity, self.truth, thresholds=(RIGHT_WITHIN_PX,))
            return 1 - judged.bad[RIGHT_WITHIN_PX] / 100, disparity
        mirrored = seen_from_the_right(fitting, self.left, self.right)
        return agreement(result, mirrored, self.left, self.right), disparity


def affordable_bench(
    matcher: StereoMatcher,
    left: npt.ArrayLike,
    right: npt.ArrayLike,
    truth: npt.ArrayLike | None = None,
    *,
    trials: int,
    budget_s: float,
) -> Bench:
    """Return the largest bench on which so many trials should fit into a budget, judged by one trial in full size.

    Pixels times disparities make the cost, so it falls with the third power of the scale.

    Raises
    ------
    ValueError
        Images that do not fit together, or settings that do not fit the images.
    """
    bench = Bench.of(left, right, truth)
    start = time.perf_counter()
    bench.merit(matcher)
    expected_s = trials * (time.perf_counter() - start)
    scale = next((scale for scale in SCALES if expected_s * scale**3 <= budget_s), SCALES[-1])
    return bench if scale == 1 else Bench.of(left, right, truth, scale=scale)
