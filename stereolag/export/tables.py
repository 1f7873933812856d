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


def metrics_csv(evaluations: Mapping[str, Evaluation]) -> str:
    """Return the figures of each method against ground truth as CSV: one line per method below a line of names.

    Parameters
    ----------
    evaluations
        By the name of the method. A figure that a method lacks, or that is NaN, is left empty.
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


def wav(signal: npt.ArrayLike, sampling_rate: float) -> bytes:
    """Return a recording as a 16-bit WAV file, as loud as it can be without clipping.

    Parameters
    ----------
    signal
        (samples,) finite numbers.
    sampling_rate
        Samples per second; rounded, for a WAV file holds a whole number.
    """
    samples = np.asarray(signal, dtype=np.float64)
    loudest = float(np.abs(samples).max(initial=0.0)) or 1.0
    stream = io.BytesIO()
    soundfile.write(stream, (samples / loudest * 32767).astype(np.int16), round(sampling_rate), format="WAV")
    return stream.getvalue()
