"""Tables of figures, and recordings, as files."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import soundfile

from stereolag.stereo.evaluation import Evaluation
from stereolag.stereo.matcher import DisparityMap


def metrics_csv(
    evaluations: Mapping[str, Evaluation],
    maps: Mapping[str, DisparityMap] | None = None,
    estimated_bad: Mapping[str, float] | None = None,
) -> str:
    """Return the figures of each method as CSV: one line per method below a line of names.

    Parameters
    ----------
    evaluations
        Evaluations against the ground truth, by the name of the method. Figures that are missing or NaN are left empty.
    maps
        Maps by the name of the method. They add the figures that need no ground truth: the share of pixels with a
        disparity, the share of measured pixels, and the computation time, seconds. Methods with only a map come last.
    estimated_bad
        Percentage of pixels that are probably off by more than 2 px, by the name of the method.
    """
    maps, estimated = maps or {}, estimated_bad or {}
    thresholds = sorted({threshold for evaluation in evaluations.values() for threshold in evaluation.bad})
    columns = ["truth_pixels", "density", "epe_px", "d1_all_percent"]
    columns += [f"bad_{threshold:g}_percent" for threshold in thresholds]
    columns += [f"bad_measured_{threshold:g}_percent" for threshold in thresholds]
    columns += ["coverage", "measured", "elapsed_s"] if maps else []
    columns += ["estimated_bad_2_percent"] if estimated else []
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["method", *columns])
    for name in dict.fromkeys([*evaluations, *maps, *estimated]):
        figures: dict[str, float] = {}
        if name in evaluations:
            figures |= figures_of(evaluations[name])
        if name in maps:
            result = maps[name]
            measured = float((result.valid & ~result.filled).mean())
            figures |= {"coverage": result.coverage, "measured": measured, "elapsed_s": result.elapsed_s}
        if name in estimated:
            figures["estimated_bad_2_percent"] = estimated[name]
        values = [figures.get(column, math.nan) for column in columns]
        table.writerow([name, *("" if math.isnan(figure) else figure for figure in values)])
    return text.getvalue()


def figures_of(evaluation: Evaluation) -> dict[str, float]:
    """Return the figures of an evaluation by name, with threshold and unit in the name: ``bad_2_percent``."""
    figures = {
        "truth_pixels": evaluation.truth_pixels,
        "density": evaluation.density,
        "epe_px": evaluation.epe,
        "d1_all_percent": evaluation.d1_all,
    }
    figures |= {f"bad_{threshold:g}_percent": share for threshold, share in evaluation.bad.items()}
    return figures | {
        f"bad_measured_{threshold:g}_percent": share for threshold, share in evaluation.bad_measured.items()
    }


def wav(signal: npt.ArrayLike, sampling_rate: float) -> bytes:
    """Return a recording as a 16-bit WAV file, as loud as it can be without clipping.

    Parameters
    ----------
    signal
        (samples,) finite numbers.
    sampling_rate
        Samples per second, rounded, since a WAV file stores a whole number.
    """
    samples = np.asarray(signal, dtype=np.float64)
    loudest = float(np.abs(samples).max(initial=0.0)) or 1.0
    stream = io.BytesIO()
    soundfile.write(stream, (samples / loudest * 32767).astype(np.int16), round(sampling_rate), format="WAV")
    return stream.getvalue()
