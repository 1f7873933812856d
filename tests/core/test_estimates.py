"""Estimates of a job match its real cost, and too large a job is refused before anything is allocated."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.memory import CLEAR_REFS
from stereolag.assess.diagnosis import diagnose
from stereolag.core.estimates import Estimate, check_memory, largest_fitting, rounded_down
from stereolag.core.limits import limits
from stereolag.signals import estimate_lag, signal_lag
from stereolag.signals.estimates import fitting_recordings, product_count
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import preset
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.templates import estimate_search, match_template
from stereolag.templates.estimates import fitting_image

GB = 10**9

SMALL = 64 * 10**6
"""Bytes by which the estimate of a small job may be too large."""

pytestmark = pytest.mark.usefixtures("_fresh_limits")


@pytest.fixture
def _fresh_limits() -> Iterator[None]:
    limits.cache_clear()
    yield
    limits.cache_clear()


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    def limit(megabytes: int) -> None:
        monkeypatch.setenv("STEREOLAG_JOB_MEMORY_MB", str(megabytes))
        limits.cache_clear()

    return limit


JOBS = {
    method: (
        f"a, b = noise({size}), noise({size})",
        f"signal_lag(a[:9000], a[100:9000], method={method!r})",
        f"signal_lag(a, b, method={method!r})",
        f"estimate_lag({size}, {size}, method={method!r})",
    )
    for method, size in (("fft", 2_000_000), ("phat", 1_500_000))
}
JOBS |= {
    "template": (
        "a = image(1500, 2000); t = a[200:900, 300:1100]",
        "match_template(a[:200, :200], a[:20, :20])",
        "match_template(a, t)",
        "estimate_search(a.shape, t.shape)",
    ),
    "resized template": (
        "a = image(900, 1200); t = a[200:300, 300:400]",
        "match_template(a[:200, :200], a[:20, :20], scales=(0.8, 1), rotations=(0, 10))",
        "match_template(a, t, scales=(0.7, 1.4), rotations=(0, 10))",
        "estimate_search(a.shape, t.shape, scales=(0.7, 1.4), rotations=(0, 10))",
    ),
}
JOBS |= {
    name: (
        f"m = {matcher}; l, r = pair({rows}, {cols})",
        "m.compute(l[:200, :600], r[:200, :600])",
        "m.compute(l, r)",
        "m.estimate(l.shape, l.dtype)",
    )
    for name, matcher, rows, cols in (
        ("fast", "preset('fast')", 2000, 2000),
        ("window FFT", "CorrelationMatcher(overlap=0.5, search=SearchArea.centred(30), engine='fft')", 1000, 1000),
        ("phase", "CorrelationMatcher(window_size=32, overlap=0.5, score='phase')", 1000, 1000),
        ("accurate", "preset('accurate')", 900, 1200),
        ("StereoBM", "StereoBM()", 2500, 3500),
        ("HH", "StereoSGBM(mode='hh')", 900, 1200),
        ("HH4", "StereoSGBM(mode='hh4', block_size=9)", 900, 1200),
    )
}
"""Setup, warm-up, job and estimate of each, as run by ``measured_memory``."""


@pytest.fixture(scope="module")
def memory() -> dict[str, tuple[int, int]]:
    """Return the bytes that each job takes, and the bytes of its estimate."""
    here = Path(__file__).parent
    answer = subprocess.run(
        [sys.executable, str(here / "measured_memory.py")],
        input=json.dumps(JOBS),
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": str(here.parents[1])},
    )
    rows = (json.loads(line) for line in answer.stdout.splitlines())
    return {name: (measured, estimated) for name, measured, estimated in rows}


@pytest.mark.skipif(not os.access(CLEAR_REFS, os.W_OK), reason="memory is measured where Linux tells it")
@pytest.mark.parametrize("job", JOBS)
def test_an_estimate_is_at_least_what_is_measured_and_at_most_twice_that(
    job: str, memory: dict[str, tuple[int, int]]
) -> None:
    measured, estimated = memory[job]
    assert measured <= estimated <= 2 * measured + SMALL


@pytest.mark.parametrize("method", ["fft", "phat", "sampled", "direct"])
def test_longer_recordings_take_more(method: Any) -> None:
    estimates = [estimate_lag(size, size, method=method) for size in (10_000, 400_000, 1_000_000, 8_000_000)]
    assert all(a.memory < b.memory and a.seconds < b.seconds for a, b in pairwise(estimates))


def test_a_shorter_reach_of_the_direct_method_is_as_much_faster_as_it_has_fewer_products() -> None:
    every = estimate_lag(10**6, 10**6, method="direct").seconds
    few = estimate_lag(10**6, 10**6, method="direct", max_lag=100).seconds
    assert every > 100  # 10**12 products
    assert few < every / 1000


@pytest.mark.parametrize(("size_1", "size_2", "reach"), [(5, 9, 3), (9, 5, 8), (4, 4, 3), (2, 30, 29), (7, 8, 0)])
def test_products_are_the_pairs_of_samples_within_the_reach(size_1: int, size_2: int, reach: int) -> None:
    pairs = sum(abs(i - j) <= reach for i in range(size_1) for j in range(size_2))
    assert product_count(size_1, size_2, reach) == pairs


@pytest.mark.parametrize("method", ["fft", "direct", "sampled"])
def test_larger_images_take_more(method: Any) -> None:
    estimates = [estimate_search((side, side, 3), (100, 200, 3), method=method) for side in (500, 2000, 4000, 7000)]
    assert all(a.memory < b.memory and a.seconds < b.seconds for a, b in pairwise(estimates))


MATCHERS = [
    *(preset(name) for name in ("report", "fast", "accurate")),
    CorrelationMatcher(engine="fft", overlap=0.5),
    CorrelationMatcher(search=SearchArea.centred(20)),
    StereoBM(),
    StereoSGBM(),
]


@pytest.mark.parametrize("matcher", MATCHERS, ids=lambda matcher: type(matcher).__name__)
def test_larger_pairs_take_more(matcher: StereoMatcher) -> None:
    estimates = [matcher.estimate((side, 2 * side, 3)) for side in (200, 600, 2000, 5000)]
    assert all(a.memory < b.memory and a.seconds < b.seconds for a, b in pairwise(estimates))


def test_a_refusal_names_the_estimate_the_limit_and_what_would_fit(limited: Callable[[int], None]) -> None:
    limited(1000)
    check_memory(Estimate(1000 * 2**20, 1.0), "never asked for")
    with pytest.raises(ValueError, match=r"needs about 2\.5 GB .* may take 1\.0 GB\. Half of it would fit\."):
        check_memory(Estimate(5 * GB // 2, 1.0), lambda allowed: "Half of it would fit.")


def test_the_largest_that_fits_is_found_by_bisection() -> None:
    def squared(size: int) -> Estimate:
        return Estimate(size * size, 0.0)

    assert largest_fitting(squared, 1000, 10_200) == 100
    assert largest_fitting(squared, 50, 10_200) == 50
    assert largest_fitting(squared, 1000, 0) == 0
    assert [rounded_down(number) for number in (7, 99, 123, 9_187_654)] == [7, 99, 120, 9_100_000]


def test_two_long_recordings_are_refused_before_they_are_copied(limited: Callable[[int], None]) -> None:
    limited(64)
    first = np.arange(1_000_000.0)
    tracemalloc.start()
    try:
        with pytest.raises(
            ValueError, match=r"one job may take 67 MB\. Two recordings of [\d,]+ samples \([\d.]+ s at"
        ):
            signal_lag(first, first)
        assert tracemalloc.get_traced_memory()[1] < first.nbytes
    finally:
        tracemalloc.stop()


def test_every_lag_of_two_hours_fits_beside_them_into_two_gigabytes() -> None:
    hour = 3600 * 44_100
    assert estimate_lag(hour, hour).memory + 2 * hour * np.dtype(np.float32).itemsize < 2 * GB
    assert estimate_lag(hour, hour, max_lag=100_000).memory < 0.3 * GB


@pytest.mark.parametrize("method", ["phat", "sampled", "direct"])
def test_thirty_million_samples_twice_do_not_fit_into_two_gigabytes(method: Any) -> None:
    assert estimate_lag(30_000_000, 30_000_000, method=method).memory > 2 * GB
    sentence = fitting_recordings(2 * GB, sampling_rate=44_100.0, method=method, max_lag=None)
    found = re.fullmatch(
        r"Two recordings of ([\d,]+) samples \(([\d.]+) s at 44,100 Hz\) would fit\. The method 'fft' takes.*", sentence
    )
    assert found is not None
    size = int(found[1].replace(",", ""))
    assert estimate_lag(size, size, method=method).memory <= 2 * GB
    assert float(found[2]) == pytest.approx(size / 44_100, rel=0.01)
    assert estimate_lag(size * 12 // 10, size * 12 // 10, method=method).memory > 2 * GB


def test_a_large_template_in_a_large_image_does_not_fit_into_two_gigabytes() -> None:
    image, template = (7000, 7000, 3), (3000, 4000, 3)
    assert estimate_search(image, template).memory > 4 * GB
    sentence = fitting_image(estimate_search, image, template, 2 * GB)
    found = re.match(r"With this template, an image of ([\d,]+) × ([\d,]+) pixels \([\d.]+ megapixels\)", sentence)
    assert found is not None
    cols, rows = (int(number.replace(",", "")) for number in found.groups())
    assert rows >= 3000
    assert cols >= 4000
    assert estimate_search((rows, cols, 3), template).memory <= 2 * GB


def test_where_the_template_alone_is_too_large_a_smaller_one_is_named() -> None:
    image, template = (7000, 7000, 3), (3000, 4000, 3)
    sentence = fitting_image(estimate_search, image, template, GB // 2)
    found = re.match(r"In this image, a template of ([\d,]+) × ([\d,]+) pixels", sentence)
    assert found is not None
    cols, rows = (int(number.replace(",", "")) for number in found.groups())
    assert estimate_search(image, (rows, cols, 3)).memory <= GB // 2


def test_a_template_search_is_refused_before_anything_is_allocated(limited: Callable[[int], None]) -> None:
    limited(64)
    image = np.random.default_rng(0).integers(0, 256, (2000, 2000), dtype=np.uint8)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"one job may take 67 MB\. With this template, an image of"):
            match_template(image, image[:300, :300])
        assert tracemalloc.get_traced_memory()[1] < image.nbytes
    finally:
        tracemalloc.stop()


def test_a_sampled_search_without_a_rare_value_is_refused(limited: Callable[[int], None]) -> None:
    limited(64)
    image = np.random.default_rng(0).integers(0, 2, (2000, 2000), dtype=np.uint8)
    with pytest.raises(ValueError, match=r"No value of the template is rare in this image; the method 'fft'"):
        match_template(image, image[:20, :20], method="sampled")


@pytest.mark.parametrize("matcher", MATCHERS, ids=lambda matcher: type(matcher).__name__)
def test_a_pair_too_large_is_refused_before_it_is_matched(
    matcher: StereoMatcher, limited: Callable[[int], None]
) -> None:
    limited(64)
    left = np.random.default_rng(0).integers(0, 256, (2000, 3000), dtype=np.uint8)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"one job may take 67 MB\. (\d+ % of|Half) the width and height") as told:
            matcher.compute(left, left)
        assert tracemalloc.get_traced_memory()[1] < left.nbytes
    finally:
        tracemalloc.stop()
    named = re.search(r"(\d+) %", str(told.value))
    percent = 50 if named is None else int(named[1])
    assert matcher.estimate((2000 * percent // 100, 3000 * percent // 100)).memory <= limits().job_memory


def test_a_refusal_names_the_number_of_disparities_that_would_fit(limited: Callable[[int], None]) -> None:
    limited(256)
    left = np.random.default_rng(0).integers(0, 256, (700, 1000), dtype=np.uint8)
    matcher = preset("accurate", num_disparities=256)
    with pytest.raises(ValueError, match=r"\d+ % of the width and height, or (\d+) disparities, would fit\.") as told:
        matcher.compute(left, left)
    named = re.search(r"or (\d+) disparities", str(told.value))
    assert named is not None
    fewer = matcher.with_search_range(0, int(named[1]))
    assert fewer.estimate(left.shape).memory <= limits().job_memory


def test_a_diagnosis_is_refused_before_it_begins(limited: Callable[[int], None]) -> None:
    limited(64)
    left = np.random.default_rng(0).integers(0, 256, (2000, 3000, 3), dtype=np.uint8)
    with pytest.raises(ValueError, match=r"one job may take 67 MB\. \d+ % of the width and height would fit\."):
        diagnose(left, left)
