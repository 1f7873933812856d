"""How right: the presets against OpenCV's matchers over every pair with truth, by the figure of merit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.pairs import FAMILIES, TruePair, true_pairs
from stereolag import CorrelationMatcher, StereoBM, StereoSGBM, evaluate

Disparity = npt.NDArray[np.float32]


@dataclass(frozen=True)
class PairFigures:
    """Bad % of every method on one pair, at the pair's own threshold."""

    pair: TruePair
    dense: float
    block: float
    accurate: float
    semi_global: float
    accurate_measured: float
    semi_global_measured: float
    accurate_density: float
    semi_global_density: float


def rows_filled(disparity: Disparity) -> Disparity:
    """Return the map with holes filled from the farther (smaller) of the nearest answers left and right in the row."""
    missing = ~np.isfinite(disparity)
    cols = np.broadcast_to(np.arange(disparity.shape[1]), disparity.shape)
    before = np.maximum.accumulate(np.where(missing, -1, cols), axis=1)
    after = np.minimum.accumulate(np.where(missing, disparity.shape[1], cols)[:, ::-1], axis=1)[:, ::-1]

    def take(index: npt.NDArray[np.intp]) -> Disparity:
        inside = (index >= 0) & (index < disparity.shape[1])
        found = np.take_along_axis(disparity, np.clip(index, 0, disparity.shape[1] - 1), axis=1)
        return np.where(inside, found, np.float32(np.inf))

    farther = np.minimum(take(before), take(after))
    return np.where(np.isfinite(farther), farther, np.float32(np.nan))


def figures_of(pair: TruePair) -> PairFigures:
    """Run every method on one pair; OpenCV on grey."""
    grey = [image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (pair.left, pair.right)]
    limit = pair.threshold

    def judged(disparity: Disparity) -> tuple[float, float, float]:
        figures = evaluate(disparity, pair.truth, thresholds=(limit,))
        return figures.bad[limit], figures.bad_measured[limit], figures.density

    block = StereoBM(num_disparities=pair.num_disparities, block_size=15).compute(*grey)
    semi_global = StereoSGBM(num_disparities=pair.num_disparities).compute(*grey)
    dense = CorrelationMatcher.preset("dense", num_disparities=pair.num_disparities).compute(pair.left, pair.right)
    accurate = CorrelationMatcher.preset("accurate", num_disparities=pair.num_disparities).compute(
        pair.left, pair.right
    )
    measured = np.where(accurate.filled, np.float32(np.nan), accurate.disparity)
    return PairFigures(
        pair=pair,
        dense=judged(dense.disparity)[0],
        block=judged(block.disparity)[0],
        accurate=judged(accurate.disparity)[0],
        semi_global=judged(rows_filled(semi_global.disparity))[0],
        accurate_measured=judged(measured)[1],
        semi_global_measured=judged(semi_global.disparity)[1],
        accurate_density=judged(measured)[2],
        semi_global_density=judged(semi_global.disparity)[2],
    )


def merit(figures: list[PairFigures], ratio: Callable[[PairFigures], float]) -> float:
    """Return the geometric mean over the families of the geometric mean of a ratio within each."""
    means = [
        math.fsum(math.log(ratio(each)) for each in family) / len(family)
        for family in ([each for each in figures if each.pair.family == name] for name in FAMILIES)
    ]
    return math.exp(math.fsum(means) / len(means))


def accuracy_tables() -> tuple[str, dict[str, object]]:
    """Return the tables as Markdown, and their figures."""
    figures = [figures_of(pair) for pair in true_pairs()]
    merits = {
        "dense / StereoBM(15), missing counted bad": (merit(figures, lambda f: f.dense / f.block), 0.65, 0.5),
        "accurate, filled / StereoSGBM, row-filled": (merit(figures, lambda f: f.accurate / f.semi_global), 0.58, 0.4),
        "accurate, measured / StereoSGBM, measured": (
            merit(figures, lambda f: f.accurate_measured / f.semi_global_measured),
            0.55,
            0.4,
        ),
    }
    density = {
        "accurate": float(np.mean([each.accurate_density for each in figures])),
        "StereoSGBM": float(np.mean([each.semi_global_density for each in figures])),
    }
    lines = ["| figure of merit | measured | must | aim |", "|---|---|---|---|"]
    lines += [f"| {name} | {value:.3f} | ≤ {must} | ≤ {aim} |" for name, (value, must, aim) in merits.items()]
    lines += [
        "",
        f"Mean density on truth, measured pixels alone: accurate {density['accurate']:.1%}, "
        f"StereoSGBM {density['StereoSGBM']:.1%}.",
        "",
        "| pair | px | dense | StereoBM | accurate, filled | SGBM, filled | accurate, measured | SGBM, measured |"
        " density | SGBM's |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {f.pair.name} | {f.pair.threshold:g} | {f.dense:.1f} | {f.block:.1f} | {f.accurate:.1f} |"
        f" {f.semi_global:.1f} | {f.accurate_measured:.1f} | {f.semi_global_measured:.1f} |"
        f" {f.accurate_density:.1%} | {f.semi_global_density:.1%} |"
        for f in figures
    ]
    values: dict[str, object] = {
        "merit": {name: value for name, (value, _, _) in merits.items()},
        "density": density,
        "pairs": {f.pair.name: {key: value for key, value in vars(f).items() if key != "pair"} for f in figures},
    }
    return "\n".join(lines), values
