"""Speed: every timed task beside its peer and beside the source report's figure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
import numpy.typing as npt
import scipy.signal
from openpiv import pyprocess

from benchmarks.long import RATE
from benchmarks.long import pair as noisy_pair
from benchmarks.memory import peak_extra_memory
from benchmarks.timing import Row, interleaved
from stereolag import (
    CorrelationMatcher,
    SearchArea,
    StereoBM,
    StereoSGBM,
    match_template,
    preset,
    read_image,
    signal_lag,
)
from stereolag.core.inputs import as_grey
from stereolag.io.recordings import read_signal
from stereolag.samples import mazes, recordings, stereo_pairs
from stereolag.stereo.matcher import StereoMatcher

Grey = npt.NDArray[np.uint8]
Signal = npt.NDArray[np.floating]

REPORT = {
    "the report's depth map: window 20, overlap 0.95, centred search 40": 111.0,
    "lag of 2 × 176,401 samples, with curve and score": 1.71,
    "Rocketman, sampled": 0.49,
    "Rocketman, RGBA with mask, fft": 2.8,
}
"""Seconds measured on the machine of the source report."""


def road() -> tuple[Grey, Grey]:
    """Return the bundled 881 × 400 pair in grey."""
    example = stereo_pairs()["road"]
    return as_grey(read_image(example.left)), as_grey(read_image(example.right))


def enlarged(image: Grey, pixels: float) -> Grey:
    """Return the image scaled to about this many pixels."""
    scale = (pixels / image.size) ** 0.5
    return np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC))


def dense(window_size: int = 20, num_disparities: int = 64) -> CorrelationMatcher:
    """Return plain dense ZNCC over a rectified strip."""
    return CorrelationMatcher(
        window_size=window_size, overlap=0.99, search=SearchArea.rectified(num_disparities), engine="window_sums"
    )


def stereo_rows() -> Iterator[Row]:
    """Yield the depth engine's tasks."""
    left, right = road()
    ours = dense()
    report = CorrelationMatcher(window_size=20, overlap=0.95, search=SearchArea.centred(40))
    fast, accurate = preset("fast", num_disparities=64), preset("accurate", num_disparities=64)
    peer_block, peer_semi_global = StereoBM(num_disparities=64, block_size=21), StereoSGBM(num_disparities=64)
    seconds = interleaved(
        {
            "dense": lambda: ours.compute(left, right),
            "block": lambda: peer_block.compute(left, right),
            "fast": lambda: fast.compute(left, right),
            "accurate": lambda: accurate.compute(left, right),
            "semi-global": lambda: peer_semi_global.compute(left, right),
        }
    )
    yield Row(
        "dense ZNCC, window 20, 64 lags, 881×400",
        seconds["dense"],
        "StereoBM(64, 21)",
        seconds["block"],
        "s",
        "≤ 2.0",
        "≤ 1.0",
    )
    yield Row(
        'preset("fast", 64), 881×400', seconds["fast"], "StereoBM(64, 21)", seconds["block"], "s", "≤ 3.0", "≤ 1.5"
    )
    yield Row(
        'preset("accurate", 64), 881×400',
        seconds["accurate"],
        "StereoSGBM(5)",
        seconds["semi-global"],
        "s",
        "≤ 2.7",
        "≤ 1.5",
    )
    yield report_row(left, right, report)
    yield window_row(left, right)
    yield size_row(left, right)
    yield memory_row(left, right)


def report_row(left: Grey, right: Grey, matcher: StereoMatcher) -> Row:
    """Time the report's depth map against OpenPIV's equivalent, extrapolated from a strip: in full it needs 26 GB."""
    strip = 60

    def openpiv() -> object:
        return pyprocess.extended_search_area_piv(
            left[:strip].astype(np.int32),
            right[:strip].astype(np.int32),
            window_size=20,
            overlap=39,
            search_area_size=40,
            correlation_method="linear",
            normalized_correlation=True,
            use_vectorized=True,
        )

    seconds = interleaved({"ours": lambda: matcher.compute(left, right), "openpiv": openpiv}, runs=3)
    rows = (left.shape[0] - 39) / (strip - 39)
    return Row(
        "the report's depth map: window 20, overlap 0.95, centred search 40",
        seconds["ours"],
        "OpenPIV (20, 39, 40)",
        seconds["openpiv"] * rows,
        "s",
        "≤ 0.01 (and ≤ 250 ms)",
        "≤ 0.0033 (and ≤ 80 ms)",
        f"OpenPIV extrapolated from a strip of {strip} rows",
    )


def window_row(left: Grey, right: Grey) -> Row:
    """Time window 41 against window 7: running sums do not depend on the window."""
    small, large = dense(7), dense(41)
    seconds = interleaved({"7": lambda: small.compute(left, right), "41": lambda: large.compute(left, right)})
    return Row("dense, window 41", seconds["41"], "window 7", seconds["7"], "s", "≤ 1.25", "1.0")


def size_row(left: Grey, right: Grey) -> Row:
    """Time per pixel and lag at 6 MP against 0.35 MP."""
    big = [enlarged(image, 6e6) for image in (left, right)]
    ours = dense()
    seconds = interleaved({"small": lambda: ours.compute(left, right), "big": lambda: ours.compute(*big)}, runs=7)
    return Row(
        "dense, per pixel and lag at 6 MP",
        seconds["big"] / big[0].size / 64,
        "at 0.35 MP",
        seconds["small"] / left.size / 64,
        "s",
        "≤ 1.25",
        "1.0",
    )


def memory_row(left: Grey, right: Grey) -> Row:
    """Measure the peak memory of 6 MP × 256 lags beyond the images and the result."""
    big = [enlarged(image, 6e6) for image in (left, right)]
    ours = dense(20, 256)
    ours.compute(left, right)
    extra = peak_extra_memory(lambda: ours.compute(*big))
    return Row(
        "dense, 6 MP, 256 lags: peak extra memory",
        extra,
        "the images and maps",
        big[0].size * 19 / 1e6,
        "MB",
        "≤ 500 MB",
        "≤ 150 MB",
    )


def signal_rows() -> Iterator[Row]:
    """Yield the tasks on the lag of two recordings: the bundled ones of 4 s, and a minute at 44.1 kHz."""
    example = recordings()["coast"]
    coast = [read_signal(path).channels[0] for path in (example.signal_1, example.signal_2)]
    minute = [recording.astype(np.float64) for recording in noisy_pair(60 * RATE, 20_000)]
    yield from lag_rows("lag of 2 × 176,401 samples", coast, runs=15)
    yield from lag_rows("lag of 2 × 1 min at 44.1 kHz", minute, runs=5)


def lag_rows(task: str, pair: Sequence[Signal], runs: int) -> Iterator[Row]:
    """Time the lag alone, and with its verdict."""
    first, second = pair
    seconds = interleaved(
        {
            "ours": lambda: signal_lag(first, second).lag,
            "judged": lambda: signal_lag(first, second).verdict,
            "scipy": lambda: np.argmax(scipy.signal.correlate(second, first, method="fft")),
        },
        runs=runs,
    )
    peer = "scipy.signal.correlate and argmax"
    yield Row(f"{task}, with curve and score", seconds["ours"], peer, seconds["scipy"], "s", "≤ 1.1", "≤ 0.7")
    yield Row(f"{task}, with its verdict", seconds["judged"], peer, seconds["scipy"], "s", "≤ 4", "≤ 2.5")


def template_rows() -> Iterator[Row]:
    """Yield the searches for Rocketman in the 3,732,596-pixel maze."""
    example = mazes()["maze"]
    picture, template = read_image(example.picture), read_image(example.template)
    grey, small = as_grey(picture), as_grey(template[:, :, :3])  # black where it is transparent: not there in grey
    row, col = example.row, example.col
    cut = np.ascontiguousarray(grey[row : row + small.shape[0], col : col + small.shape[1]])
    opaque = np.repeat((template[:, :, 3:] > 127).astype(np.uint8), 3, axis=2)
    shown, colour = (np.ascontiguousarray(one[:, :, :3]) for one in (picture, template))
    seconds = interleaved(
        {
            "sampled": lambda: match_template(picture, template, method="sampled"),
            "grey": lambda: match_template(grey, small),
            "grey peer": lambda: cv2.matchTemplate(grey, small, cv2.TM_CCOEFF_NORMED),
            "cut": lambda: match_template(grey, cut),
            "cut peer": lambda: cv2.matchTemplate(grey, cut, cv2.TM_CCOEFF_NORMED),
            "colour": lambda: match_template(shown, colour),
            "colour peer": lambda: cv2.matchTemplate(shown, colour, cv2.TM_CCOEFF_NORMED),
            "masked": lambda: match_template(picture, template),
            "masked peer": lambda: cv2.matchTemplate(shown, colour, cv2.TM_CCOEFF_NORMED, mask=opaque),
        },
        runs=7,
    )
    yield Row(
        "Rocketman, sampled",
        seconds["sampled"],
        "masked matchTemplate",
        seconds["masked peer"],
        "s",
        "≤ 60 ms",
        "≤ 20 ms",
    )
    for name, title in (("cut", "a cutting in grey, fft"), ("grey", "Rocketman in grey, who is not there, fft")):
        yield Row(
            title, seconds[name], "matchTemplate(TM_CCOEFF_NORMED)", seconds[f"{name} peer"], "s", "≤ 1.0", "≤ 0.8"
        )
    yield Row(
        "Rocketman, colour, fft",
        seconds["colour"],
        "matchTemplate(TM_CCOEFF_NORMED)",
        seconds["colour peer"],
        "s",
        "≤ 0.8",
        "≤ 0.4",
    )
    yield Row(
        "Rocketman, RGBA with mask, fft",
        seconds["masked"],
        "masked matchTemplate",
        seconds["masked peer"],
        "s",
        "≤ 0.2",
        "≤ 0.15",
    )
