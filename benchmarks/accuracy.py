"""Accuracy of the presets against OpenCV's matchers on every pair with ground truth, by the figure of merit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.pairs import FAMILIES, TruePair, true_pairs
from stereolag import StereoBM, StereoSGBM, evaluate, preset
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PRESETS

Disparity = npt.NDArray[np.float32]

FAST, ACCURATE = PRESETS["fast"].title, PRESETS["accurate"].title
SGBM, BLOCK_15 = StereoSGBM.title, "StereoBM(15)"


@dataclass(frozen=True)
class Judged:
    """Bad % at the pair's threshold of all pixels, missing ones included, and of measured pixels only; density."""

    bad: float
    bad_measured: float
    density: float


@dataclass(frozen=True)
class PairFigures:
    """The figures of every method on one pair, by title, in the variants needed for the figures of merit."""

    pair: TruePair
    maps: dict[str, Judged]
    """Of the map that the method returns."""
    measured: dict[str, Judged]
    """Without filled pixels."""
    filled: dict[str, Judged]
    """With holes filled along rows."""


def rows_filled(disparity: Disparity) -> Disparity:
    """Return the map with holes filled by the farther (smaller) of the nearest disparities on both sides in the row."""
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


def contestants(num_disparities: int) -> dict[str, StereoMatcher]:
    """Return every preset, and every method with its default settings, over the same range."""
    presets = {PRESETS[name].title: preset(name, num_disparities) for name in PRESETS if name != "report"}
    return presets | {method.title: method().with_search_range(0, num_disparities) for method in METHODS}


def figures_of(pair: TruePair) -> PairFigures:
    """Run every method on one pair; OpenCV's run on grey images."""
    limit = pair.threshold

    def judged(disparity: Disparity) -> Judged:
        figures = evaluate(disparity, pair.truth, thresholds=(limit,))
        return Judged(figures.bad[limit], figures.bad_measured[limit], figures.density)

    # OpenCV's default block, and 15 px, the result of tuning StereoBM on these pairs.
    methods = contestants(pair.num_disparities) | {
        BLOCK_15: StereoBM(num_disparities=pair.num_disparities, block_size=15)
    }
    maps = {title: matcher.compute(pair.left, pair.right) for title, matcher in methods.items()}
    return PairFigures(
        pair,
        {title: judged(one.disparity) for title, one in maps.items()},
        {title: judged(np.where(one.filled, np.float32(np.nan), one.disparity)) for title, one in maps.items()},
        {title: judged(rows_filled(one.disparity)) for title, one in maps.items()},
    )


def merit(figures: list[PairFigures], ratio: Callable[[PairFigures], float]) -> float:
    """Return the geometric mean over the families of the geometric mean of a ratio within each."""
    means = [
        math.fsum(math.log(ratio(each)) for each in family) / len(family)
        for family in ([each for each in figures if each.pair.family == name] for name in FAMILIES)
    ]
    return math.exp(math.fsum(means) / len(means))


FORMS = {"× 16": (0, 16.0), "20,000 + 4 ×": (20_000, 4.0), "7,000 + 3.3 ×": (7_000, 3.3)}
"""Offset and gain by which pixels of 8 bits are converted to 16."""


def worst_changes() -> dict[str, float]:
    """Return the largest change of bad %, over all pairs and presets, of pairs of 16 bits against those of 8 bits."""
    worst = dict.fromkeys(FORMS, 0.0)
    for pair in true_pairs():
        for name in PRESETS:
            matcher = preset(name, pair.num_disparities)

            def bad(left: npt.NDArray[np.generic], right: npt.NDArray[np.generic]) -> float:
                found = matcher.compute(left, right).disparity  # noqa: B023
                return evaluate(found, pair.truth, thresholds=(pair.threshold,)).bad[pair.threshold]  # noqa: B023

            bad_of_bytes = bad(pair.left, pair.right)
            for form, (pedestal, gain) in FORMS.items():
                deep = (np.rint(pedestal + one * gain).astype(np.uint16) for one in (pair.left, pair.right))
                worst[form] = max(worst[form], abs(bad(*deep) - bad_of_bytes))
    return worst


def accuracy_tables() -> tuple[str, dict[str, object]]:
    """Return the tables as Markdown, and their figures."""
    figures = [figures_of(pair) for pair in true_pairs()]
    merits = {
        "fast / StereoBM(15), missing counted bad": (
            merit(figures, lambda f: f.maps[FAST].bad / f.maps[BLOCK_15].bad),
            0.65,
            0.5,
        ),
        "accurate, filled / StereoSGBM, row-filled": (
            merit(figures, lambda f: f.maps[ACCURATE].bad / f.filled[SGBM].bad),
            0.58,
            0.4,
        ),
        "accurate, measured / StereoSGBM, measured": (
            merit(figures, lambda f: f.measured[ACCURATE].bad_measured / f.measured[SGBM].bad_measured),
            0.55,
            0.4,
        ),
    }
    lines = ["| figure of merit | measured | must | aim |", "|---|---|---|---|"]
    lines += [f"| {name} | {value:.3f} | ≤ {must} | ≤ {aim} |" for name, (value, must, aim) in merits.items()]
    titles = list(figures[0].maps)
    for heading, kind in (
        ("Bad %, missing pixels counted wrong", lambda f, title: f"{f.maps[title].bad:.1f}"),
        ("Bad % of the measured pixels alone", lambda f, title: f"{f.measured[title].bad_measured:.1f}"),
        ("Density of the measured pixels", lambda f, title: f"{f.measured[title].density:.1%}"),
        ("Bad %, holes filled along the row", lambda f, title: f"{f.filled[title].bad:.1f}"),
    ):
        lines += ["", f"{heading}:", "", f"| pair | px | {' | '.join(titles)} |", "|---" * (2 + len(titles)) + "|"]
        lines += [
            f"| {f.pair.name} | {f.pair.threshold:g} | {' | '.join(kind(f, title) for title in titles)} |"
            for f in figures
        ]
    twins = worst_changes()
    lines += ["", "Worst change of bad % in another form of the pixels, of all pairs and presets:", ""]
    lines += ["| form | points | must |", "|---|---|---|", *(f"| {form} | {twins[form]:.2f} | ≤ 3 |" for form in twins)]
    values: dict[str, object] = {
        "twins": twins,
        "merit": {name: value for name, (value, _, _) in merits.items()},
        "pairs": {
            f.pair.name: {
                kind: {title: asdict(one) for title, one in getattr(f, kind).items()}
                for kind in ("maps", "measured", "filled")
            }
            for f in figures
        },
    }
    return "\n".join(lines), values
