"""The scoreboard as a table."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping

from stereolag.stereo.evaluation import Evaluation


def metrics_csv(evaluations: Mapping[str, Evaluation]) -> str:
    """Return the figures of each method against the truth, one line a method, under one line of names with units.

    Parameters
    ----------
    evaluations
        By the name of the method. A figure that a method has not, or that is NaN, is left empty.
    """
    thresholds = sorted({threshold for evaluation in evaluations.values() for threshold in evaluation.bad})
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(
        [
            "method",
            "truth_pixels",
            "density",
            "epe_px",
            "d1_all_percent",
            *(f"bad_{threshold:g}_percent" for threshold in thresholds),
            *(f"bad_measured_{threshold:g}_percent" for threshold in thresholds),
        ]
    )
    for name, evaluation in evaluations.items():
        figures = [
            evaluation.density,
            evaluation.epe,
            evaluation.d1_all,
            *(evaluation.bad.get(threshold, math.nan) for threshold in thresholds),
            *(evaluation.bad_measured.get(threshold, math.nan) for threshold in thresholds),
        ]
        table.writerow([name, evaluation.truth_pixels, *("" if math.isnan(figure) else figure for figure in figures)])
    return text.getvalue()
