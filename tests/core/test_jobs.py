"""Limits in the environment; the cost table matches real costs; too large a job is refused before it allocates."""

import json
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from benchmarks.memory import CLEAR_REFS
from stereolag import CorrelationMatcher, SearchArea, StereoBM, StereoSGBM, diagnose, preset
from stereolag.core import jobs
from stereolag.core.jobs import COSTS, Estimate, check_memory, limits, machine_memory, set_defaults
from stereolag.signals import estimate_lag, signal_lag
from stereolag.signals.lag import product_count
from stereolag.stereo.matcher import StereoMatcher
from stereolag.templates import estimate_search, match_template

GB = 10**9

SMALL = {"StereoBM": 48 * 10**6}
"""Bytes by which the estimate of a small job may be too large, where it is more than half of that."""


@pytest.fixture(autouse=True)
def _as_found(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(jobs, "_defaults", {})
    limits.cache_clear()
    yield
    limits.cache_clear()


@pytest.fixture
def limited(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    def limit(megabytes: int) -> None:
        monkeypatch.setenv("STEREOLAG_JOB_MEMORY_MB", str(megabytes))
        limits.cache_clear()

    return limit


def test_the_environment_comes_before_the_defaults_of_a_server(limited: Callable[[int], None]) -> None:
    assert (limits().max_pixels, limits().max_samples) == (50_000_000, 320_000_000)
    set_defaults(job_memory_mb=200)
    assert limits().job_memory == 200 * 2**20
    limited(100)
    assert limits().job_memory == 100 * 2**20
    limited(10**9)
    assert limits().job_memory == machine_memory() // 2


@pytest.mark.parametrize(
    ("variable", "value", "allowed"),
    [
        ("STEREOLAG_MAX_MEGAPIXELS", "many", "from 4 to 1000"),
        ("STEREOLAG_MAX_MEGASAMPLES", "0", "from 1 to 10000"),
        ("STEREOLAG_JOB_MEMORY_MB", "8", "from 64"),
    ],
)
def test_a_bad_variable_is_named(monkeypatch: pytest.MonkeyPatch, variable: str, value: str, allowed: str) -> None:
    monkeypatch.setenv(variable, value)
    limits.cache_clear()
    with pytest.raises(ValueError, match=f"{variable} is '{value}'; allowed are whole numbers {allowed}"):
        limits()


MB_256 = "268435456"


@pytest.mark.parametrize(
    ("joined", "files", "megabytes"),
    [
        ("0::/\n", {"memory.max": MB_256}, 256),  # a container
        ("4:cpu:/\n3:memory:/docker/b7\n", {"memory/memory.limit_in_bytes": MB_256}, 256),  # cgroup version 1
        ("0::/apps/app.service\n", {"apps/app.service/memory.max": MB_256}, 256),
        ("0::/apps/app.service\n", {"apps/app.service/memory.max": "max", "apps/memory.max": MB_256}, 256),
        ("0::/app.service\n", {"app.service/memory.max": "max", "other.service/memory.max": "1"}, None),
        ("1:name=systemd:/app.service\n", {"app.service/memory.max": "1"}, None),
        (None, {"memory.max": "1"}, None),  # not Linux
    ],
)
def test_a_container_and_a_service_have_the_memory_of_their_groups(monkeypatch, tmp_path, joined, files, megabytes):
    for name, limit in files.items():
        file = tmp_path / "groups" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"{limit}\n")
    if joined is not None:
        (tmp_path / "joined").write_text(joined)
    monkeypatch.setattr(jobs, "_CGROUP_ROOT", tmp_path / "groups")
    monkeypatch.setattr(jobs, "_OWN_CGROUPS", tmp_path / "joined")
    machine_memory.cache_clear()
    try:
        whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        assert machine_memory() == (whole if megabytes is None else megabytes * 2**20)
        assert limits().job_memory == machine_memory() // 2
    finally:
        machine_memory.cache_clear()


def _lag(size: int, warm: int = 9000, options: str = "") -> tuple[str, str, str, str]:
    return (
        f"a, b = noise({size}), noise({size})",
        f"sl.signal_lag(a[:{warm}], a[100:{warm}]{options}).verdict",
        f"sl.signal_lag(a, b{options}).verdict",
        f"signals.estimate_lag({size}, {size}{options})",
    )


def _search(image: str, template: str, options: str = "") -> tuple[str, str, str, str]:
    return (
        f"a = {image}; t = {template}",
        f"[sl.match_template(a[:200, :200], some{options}) for some in (a[:20, :20], a[-40:, -40:])]",
        f"sl.match_template(a, t{options})",
        f"templates.estimate_search(a.shape, t.shape, dtype=a.dtype{options})",
    )


def _match(matcher: str, rows: int, cols: int) -> tuple[str, str, str, str]:
    return (
        f"m = {matcher}; l, r = pair({rows}, {cols})",
        "m.compute(l[:200, :600], r[:200, :600])",
        "m.compute(l, r)",
        "m.estimate(l.shape, l.dtype)",
    )


JOBS = {
    "lag by fft": _lag(150_000),
    "lag by blocks": _lag(150_000, warm=30_000, options=", max_lag=2_000"),
    # Noise has the most to search for, but takes 12 s; what is judged after the bands, "by blocks" measures.
    "lag by bands": ("a = noise(9_000_000); b = np.roll(a, 100)", *_lag(9_000_000)[1:]),
    "lag by products": _lag(200_000, options=", method='direct', max_lag=40"),
    "lag by votes": _lag(60_000, options=", method='sampled'"),
    "template by fft": _search("image(1060, 1414)", "a[200:700, 300:870]"),
    "template by fft, nearly as large as the blurred picture": _search(
        "image(740, 990)", "a[14:714, 20:930].copy(); a = cv2.GaussianBlur(a, (0, 0), 0.9)"
    ),
    "template by fft, large and in colours": _search("colours(740, 990)", "a[140:490, 210:610]"),
    "template by fft, nowhere": _search("image(1060, 1414)", "image(30, 30)"),
    "template by fft, in colours nowhere": _search("colours(640, 850)", "colours(110, 110)"),
    "template by fft, masked": _search("colours(640, 850)", "masked(a[200:410, 300:580])"),
    "template by poses": _search("image(640, 850)", "a[200:270, 300:370]", ", scales=(0.7, 1.4), rotations=(0, 10)"),
    "template by products": _search("image(1414, 1414)", "a[9:12, 9:12]", ", method='direct'"),
    "template by pixels": (
        "a = image(2100, 2800); t = a[200:230, 300:330]",
        "sl.match_template(a[:400, :400], t, method='sampled')",
        "sl.match_template(a, t, method='sampled', seed=0)",
        "templates.estimate_search(a.shape, t.shape, method='sampled')",
    ),
    "template by OpenCV": (
        "a = colours(1060, 1414); t = masked(a[20:50, 20:50])",
        "trials.opencv_search(a[:200, :200], t)",
        "trials.opencv_search(a, t)",
        "trials.estimate_opencv(a.shape, True)",
    ),
    "stereo": _match("Still()", 1800, 2450),
    "windows": _match("sl.preset('fast')", 1414, 1414),
    "windows, FFT": _match(
        "sl.CorrelationMatcher(overlap=0.5, search=sl.SearchArea.centred(30), engine='fft')", 720, 720
    ),
    "windows, phase": _match("sl.CorrelationMatcher(window_size=32, overlap=0.5, score='phase')", 720, 720),
    "semi-global": _match("sl.preset('accurate')", 640, 850),
    "StereoBM": _match("sl.StereoBM()", 1800, 2450),
    "StereoSGBM": _match("sl.StereoSGBM(mode='hh')", 640, 850),
    "flow": _match("flow.FlowMatcher(search=16, levels=3)", 500, 640),
    "diagnosis": (
        "l = colours(600, 800); r = np.roll(l, -8, axis=1)",
        "sl.diagnose(l[:200, :300], r[:200, :300])",
        "sl.diagnose(l, r)",
        "diagnosis.estimate_diagnosis(l.shape, l.dtype)",
    ),
}
"""Setup, warm-up, job and estimate of at least one job for each row of the table, as run by ``measured_memory``."""


@pytest.mark.skipif(not os.access(CLEAR_REFS, os.W_OK), reason="memory is measured where Linux tells it")
def test_an_estimate_of_every_row_is_at_least_what_is_measured_and_at_most_twice_that() -> None:
    assert {name.partition(",")[0] for name in JOBS} == set(COSTS)
    here = Path(__file__).parent
    answer = subprocess.run(
        [sys.executable, str(here / "measured_memory.py")],
        input=json.dumps(JOBS),
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": str(here.parents[1])},
    )
    rows = [json.loads(line) for line in answer.stdout.splitlines()]
    assert [name for name, _, _ in rows] == [*JOBS]
    assert not [
        (name, measured, told)
        for name, measured, told in rows
        if not measured <= told <= 2 * measured + SMALL.get(name, 20 * 10**6)
    ]


MATCHERS: list[StereoMatcher] = [
    *(preset(name) for name in ("report", "fast", "accurate")),
    CorrelationMatcher(engine="fft", overlap=0.5),
    CorrelationMatcher(search=SearchArea.centred(20)),
    StereoBM(),
    StereoSGBM(),
]


def estimated(job: str | StereoMatcher, side: int) -> Estimate:
    """Return the estimate of a job on inputs of about side × side values: a lag, a search, or a matcher's map."""
    if not isinstance(job, str):
        return job.estimate((side, 2 * side, 3))
    kind, method = job.split()
    if kind == "lag":
        return estimate_lag(side**2, side**2, method=method)
    return estimate_search((side, side, 3), (100, 200, 3), method=method)


@pytest.mark.parametrize(
    "job",
    ["lag fft", "lag phat", "lag sampled", "lag direct", "search fft", "search direct", "search sampled", *MATCHERS],
    ids=str,
)
def test_larger_inputs_take_more(job: str | StereoMatcher) -> None:
    estimates = [estimated(job, side) for side in (500, 1000, 2000, 2800)]
    assert all(a.memory < b.memory and a.seconds < b.seconds for a, b in pairwise(estimates))


@pytest.mark.parametrize(("size_1", "size_2", "reach"), [(5, 9, 3), (9, 5, 8), (4, 4, 3), (2, 30, 29), (7, 8, 0)])
def test_products_are_the_pairs_of_samples_within_the_reach(size_1: int, size_2: int, reach: int) -> None:
    pairs = sum(abs(i - j) <= reach for i in range(size_1) for j in range(size_2))
    assert product_count(size_1, size_2, reach) == pairs


def test_every_lag_of_two_hours_fits_beside_them_into_two_gigabytes() -> None:
    hour = 3600 * 44_100
    assert estimate_lag(hour, hour).memory + 2 * hour * np.dtype(np.float32).itemsize < 2 * GB
    assert estimate_lag(hour, hour, max_lag=100_000).memory < 0.5 * GB
    every, few = (estimate_lag(10**6, 10**6, method="direct", max_lag=reach).seconds for reach in (None, 100))
    assert every > 100 and few < every / 1000  # 10**12 products, and 2 * 10**8


def test_a_refusal_names_the_estimate_and_the_limit(limited: Callable[[int], None]) -> None:
    limited(1000)
    check_memory(Estimate(1000 * 2**20, 1.0))
    with pytest.raises(ValueError, match=r"^This needs about 2\.5 GB of memory, and one job may take 1\.0 GB\.$"):
        check_memory(Estimate(5 * GB // 2, 1.0))


@pytest.mark.parametrize(
    ("shape", "job"),
    [
        ((8_000_000,), lambda given: signal_lag(given.view(np.int64), given.view(np.int64))),
        ((2000, 2000), lambda image: match_template(image, image[:300, :300])),
        ((2000, 3000, 3), lambda left: diagnose(left, left)),
        *(((2000, 3000), lambda left, matcher=matcher: matcher.compute(left, left)) for matcher in MATCHERS),
    ],
)
def test_a_job_too_large_is_refused_before_it_makes_a_copy_of_its_input(limited, shape, job):
    limited(64)
    given = np.random.default_rng(0).integers(0, 256, shape, dtype=np.uint8)
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"needs about \d.* of memory, and one job may take 67 MB\.$"):
            job(given)
        assert tracemalloc.get_traced_memory()[1] < given.nbytes
    finally:
        tracemalloc.stop()


def test_a_sampled_search_without_a_rare_value_names_another_method(limited: Callable[[int], None]) -> None:
    limited(64)
    image = np.random.default_rng(0).integers(0, 2, (2000, 2000), dtype=np.uint8)
    with pytest.raises(ValueError, match=r"No value of the template is rare in this image; the method 'fft'"):
        match_template(image, image[:20, :20], method="sampled")
