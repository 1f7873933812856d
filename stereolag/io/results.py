"""Results as files: tables and JSON documents of lags, template searches and disparity maps, and lags in words."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:  # a command imports only the modules of its own measurement
    from stereolag.core.searches import LagSearch, TemplateQuery
    from stereolag.signals import SignalLag
    from stereolag.signals.over_time import LagOverTime
    from stereolag.stereo.evaluation import Evaluation
    from stereolag.stereo.matcher import DisparityMap
    from stereolag.templates import TemplateSearch


def figures_json(figures: Mapping[str, Any], *, indent: int | None = None) -> str:
    """Return figures as JSON, on one line unless indented; NaN and infinity, which JSON does not have, become null."""
    return json.dumps(_json_value(figures), allow_nan=False, indent=indent)


def _json_value(value: Any) -> Any:
    """Return a value as the types of JSON."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(name): _json_value(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(one) for one in value]
    if isinstance(value, Path):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def csv_lines(rows: Iterable[Iterable[object]]) -> str:
    """Return rows as lines of CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def metrics_csv(
    evaluations: Mapping[str, Evaluation],
    maps: Mapping[str, DisparityMap] | None = None,
    estimated_bad: Mapping[str, float] | None = None,
) -> str:
    """Return the figures of each method as CSV: one line per method below a header.

    Parameters
    ----------
    evaluations
        Evaluations against the ground truth, by the name of the method. Figures that are missing or NaN are left empty.
    maps
        Maps by the name of the method. They add the figures that need no ground truth: the share of pixels that
        are measured, the share filled in, and the computation time, seconds. Methods with only a map come last.
    estimated_bad
        Estimated percentage of pixels that are off by more than 2 px, by the name of the method.
    """
    maps, estimated = maps or {}, estimated_bad or {}
    thresholds = sorted({threshold for evaluation in evaluations.values() for threshold in evaluation.bad})
    columns = [
        *("truth_pixels", "density", "epe_px", "d1_all_percent"),
        *(f"bad_{threshold:g}_percent" for threshold in thresholds),
        *(f"bad_measured_{threshold:g}_percent" for threshold in thresholds),
        *(("coverage", "filled", "elapsed_s") if maps else ()),
        *(("estimated_bad_2_percent",) if estimated else ()),
    ]
    rows = [["method", *columns]]
    for name in dict.fromkeys([*evaluations, *maps, *estimated]):
        figures = figures_of(evaluations[name]) if name in evaluations else {}
        if name in maps:
            result = maps[name]
            figures |= {
                "coverage": result.coverage,
                "filled": float(result.filled.mean()),
                "elapsed_s": result.elapsed_s,
            }
        if name in estimated:
            figures["estimated_bad_2_percent"] = estimated[name]
        values = [figures.get(column, math.nan) for column in columns]
        rows.append([name, *("" if math.isnan(figure) else figure for figure in values)])
    return csv_lines(rows)


def figures_of(evaluation: Evaluation) -> dict[str, float]:
    """Return the figures of an evaluation by name, with threshold and unit in the name: ``bad_2_percent``."""
    return {
        "truth_pixels": evaluation.truth_pixels,
        "density": evaluation.density,
        "epe_px": evaluation.epe,
        "d1_all_percent": evaluation.d1_all,
        **{f"bad_{threshold:g}_percent": share for threshold, share in evaluation.bad.items()},
        **{f"bad_measured_{threshold:g}_percent": share for threshold, share in evaluation.bad_measured.items()},
    }


def search_figures(result: TemplateSearch, query: TemplateQuery) -> dict[str, Any]:
    """Return the figures printed by ``stereolag find --json``: all results but the score map, and the settings."""
    return {
        "command": "find",
        "found": result.found,
        **{field.name: getattr(result, field.name) for field in fields(result) if field.name != "score_map"},
        "settings": query.model_dump(),
    }


def left_out_in_words(result: TemplateSearch) -> str:
    """Return a sentence on the share of positions without a score, where the image has no data; empty if none."""
    if not result.left_out:
        return ""
    share = f"{100 * result.left_out:.0f} %" if result.left_out >= 0.01 else "Less than 1 %"
    return f"{share} of the places hold missing values and were left out."


def matches_json(result: TemplateSearch, query: TemplateQuery) -> str:
    """Return :func:`search_figures` as an indented JSON document; a figure that is NaN or infinite is null."""
    return figures_json(search_figures(result, query), indent=2) + "\n"


def matches_csv(result: TemplateSearch) -> str:
    """Return the matches as CSV, best first: one line per match below a header.

    The last column is ``clear``: 1 if a match is the template, else 0. Gains and blocks are only in the JSON.
    """
    from stereolag.templates import TemplateMatch

    names = [field.name for field in fields(TemplateMatch) if field.name not in ("gain", "blocks")]
    rows = [
        [*(getattr(match, name) for name in names), int(number < result.clear)]
        for number, match in enumerate(result.matches)
    ]
    return csv_lines([[*names, "clear"], *rows])


def lag_figures(result: SignalLag, search: LagSearch, assumed: Collection[str] = ()) -> dict[str, Any]:
    """Return the figures of a lag by name, as printed by ``stereolag lag --json``, and the settings of the search.

    The command adds ``recordings``, facts about its files. `assumed` names the settings that neither a file nor the
    user gave: ``"speed"``, ``"sampling_rate"``.
    """
    over_time = result.over_time
    return {
        "command": "lag",
        "lag_samples": result.lag,
        "lag_subsample": result.lag_subsample,
        "time_s": result.time_s,
        "distance_m": result.distance_m,
        "score": result.score,
        "peak_ratio": result.peak_ratio,
        "ties": result.ties,
        "verdict": result.verdict,
        "reason": result.judgement.reason if result.judgement else None,
        "rivals": list(result.rivals),
        "arrivals": [{"lag_samples": one.lag, "sigma": one.sigma} for one in result.arrivals],
        "inverted": result.inverted,
        "begins_again_at": result.begins_again_at,
        "over_time": over_time and _over_time_figures(over_time, result.sampling_rate),
        "drift_ppm": result.drift_ppm,
        "uncertainty_samples": result.uncertainty,
        "elapsed_s": result.elapsed_s,
        "settings": search.model_dump(),
        "assumed": {name: value for name, value in search.model_dump().items() if name in assumed},
    }


def _over_time_figures(over_time: LagOverTime, sampling_rate: float) -> dict[str, Any]:
    """Return the lag over time by name: samples, ppm, and for each step its time in recording 1, seconds."""
    return {
        "start": over_time.start,
        "end": over_time.end,
        "ppm": over_time.ppm,
        "error_ppm": over_time.error_ppm,
        "steps": [
            {
                "time_s": step.place / sampling_rate,
                "before": step.before,
                "after": step.after,
                "missing_in_recording_2": step.missing,
            }
            for step in over_time.steps
        ],
    }


_MAX_STEPS_IN_WORDS = 3
"""Maximum number of steps that a sentence lists."""


def over_time_in_words(over_time: LagOverTime, sampling_rate: float) -> str:
    """Return the lag over time in words: "2,777 samples later at the start, 2,833 at the end (+136 ± 0.2 ppm)".

    Of recording 2, with the times of steps on the clock of recording 1.
    """
    steps = over_time.steps
    drift = f"{over_time.ppm:+,.1f} ± {max(over_time.error_ppm, 0.1):.1g} ppm"
    lags = _lags_in_words(
        [over_time.start, over_time.end] if not steps else [steps[0].before, *(one.after for one in steps)]
    )
    if not steps:
        return f"{lags[0]} at the start, {lags[1]} at the end ({drift})"
    segments = [
        f"{lag} from {step.place / sampling_rate:,.1f} s on" if number else f"then {lag}"
        for number, (step, lag) in enumerate(zip(steps, lags[1:], strict=True))
    ]
    words = f"{lags[0]} until {steps[0].place / sampling_rate:,.1f} s, {', '.join(segments[:_MAX_STEPS_IN_WORDS])}"
    if len(steps) > _MAX_STEPS_IN_WORDS:
        words += f" and {len(steps) - _MAX_STEPS_IN_WORDS} more"
    if over_time.drifts:
        words += f" ({drift})"
    lost_s = {
        number: sum(max(0.0, sign * step.missing) for step in steps) / sampling_rate
        for number, sign in ((1, -1), (2, 1))
    }
    missing = [f"{seconds:.3g} s are missing in recording {number}" for number, seconds in lost_s.items() if seconds]
    return f"{words}: {' and '.join(missing)}"


def _lags_in_words(lags: Sequence[float]) -> list[str]:
    """Return lags in words, with the direction only where it changes: "2 samples earlier", "5 later", "7"."""
    words: list[str] = []
    previous = ""
    for lag in lags:
        number, direction = f"{abs(round(lag)):,}", "later" if round(lag) >= 0 else "earlier"
        words.append(f"{number}{'' if words else ' samples'}{'' if direction == previous else f' {direction}'}")
        previous = direction
    return words


def lag_json(result: SignalLag, search: LagSearch, assumed: Collection[str] = ()) -> str:
    """Return :func:`lag_figures` as an indented JSON document; a figure that is NaN or infinite is null."""
    return figures_json(lag_figures(result, search, assumed), indent=2) + "\n"


def curve_csv(result: SignalLag, sampling_rate: float, max_lags: int | None = None) -> str:
    """Return the correlation curve of a lag as CSV: ``lag_samples``, ``time_s`` and ``correlation``, by ascending lag.

    Every number has all its digits. The method "sampled" has ``votes`` in place of a correlation. At most `max_lags`
    around the lag found are written; all by default.
    """
    if result.lags is not None and result.correlation is not None:
        name, lags, values = "correlation", np.asarray(result.lags), result.correlation
    else:
        votes = dict(sorted((result.votes or {}).items()))
        name, lags, values = "votes", np.array([*votes], dtype=np.int64), np.array([*votes.values()], dtype=np.int64)
    if max_lags is not None and lags.size > max_lags:
        first = min(max(0, int(np.searchsorted(lags, result.lag)) - max_lags // 2), lags.size - max_lags)
        lags, values = lags[first : first + max_lags], values[first : first + max_lags]
    rows = zip(lags.tolist(), (lags / sampling_rate).tolist(), values.tolist(), strict=True)
    return csv_lines([["lag_samples", "time_s", name], *rows])
