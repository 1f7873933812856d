"""Results as files are read back; programs and commands of searches are run again."""

import csv
import io
import json
import shlex
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commanded import Command
from pydantic import Field

import stereolag as sl
from stereolag.commands.arguments import CommandParser, SettingsFlags
from stereolag.core.arrays import Vector
from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.io.arrays import npy
from stereolag.io.images import image_png
from stereolag.io.programs import find_command, find_script, lag_command, lag_script
from stereolag.io.recordings import aligned_file, check_wav, write_aligned
from stereolag.io.results import (
    curve_csv,
    lag_json,
    matches_csv,
    matches_json,
    metrics_csv,
    over_time_in_words,
    search_figures,
)
from stereolag.signals.over_time import LagOverTime, Stretch
from tests.programs import run_program


def apart(lag: int, size: int = 3000) -> tuple[Vector, Vector]:
    """Return two recordings, the second of which hears the sound `lag` samples later."""
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, size + abs(lag))
    first, second = noise[max(0, lag) :][:size], noise[max(0, -lag) :][:size]
    return first, second


def measured(lag: int, search: LagSearch, size: int = 3000) -> sl.SignalLag:
    return sl.signal_lag(*apart(lag, size), **search.model_dump(), seed=0)


def without_time(document: str) -> dict[str, Any]:
    """Return the figures without the elapsed time, and without the details of the files that a command adds."""
    left_out = "elapsed_s", "recordings", "starts_apart_s", "doubts"
    return {name: value for name, value in json.loads(document).items() if name not in left_out}


@pytest.mark.parametrize(("lag", "method"), [(-700, "fft"), (0, "direct"), (123, "phat")])
def test_the_curve_comes_back_with_all_its_digits(lag: int, method: str) -> None:
    result = measured(lag, LagSearch(method=method))
    lines = [*csv.DictReader(io.StringIO(curve_csv(result, 8000.0)))]
    np.testing.assert_array_equal([int(line["lag_samples"]) for line in lines], result.lags)
    np.testing.assert_array_equal([float(line["correlation"]) for line in lines], result.correlation)
    np.testing.assert_array_equal([float(line["time_s"]) for line in lines], result.lags / 8000)
    for most in (1, 100, 10_000):
        shorter = csv.DictReader(io.StringIO(curve_csv(result, 8000.0, most)))
        lags = [int(line["lag_samples"]) for line in shorter]
        assert len(lags) == min(most, 5999)
        assert lags == [*range(lags[0], lags[0] + len(lags))]
        assert lag in lags


def test_votes_stand_in_the_place_of_a_correlation() -> None:
    result = measured(123, LagSearch(method="sampled"))
    lines = [*csv.DictReader(io.StringIO(curve_csv(result, 8000.0)))]
    assert {int(line["lag_samples"]): int(line["votes"]) for line in lines} == result.votes
    assert [int(line["lag_samples"]) for line in lines] == sorted(result.votes)


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (900.0, 2048.0)])
@pytest.mark.parametrize("lag", [-700, 0, 123])
def test_the_aligned_files_are_read_back_with_no_lag(lag, gain, offset, monkeypatch):
    monkeypatch.setattr("stereolag.signals.alignment.BLOCK", 777)
    first, second = (gain * signal + offset for signal in apart(lag))
    aligned = sl.align(first, second, lag)
    sound = sl.read_signal(aligned_file(".wav", first, second, sl.signal_lag(first, second), 8000.0))
    assert sound.sampling_rate == 8000
    loudest = max(1.0, np.abs(second).max())
    np.testing.assert_allclose(sound.channels[0] * loudest, aligned, atol=0.02 * gain)
    table = sl.read_signal(aligned_file(".csv", first, second, lag, 8000.0))
    assert table.sampling_rate == pytest.approx(8000)
    np.testing.assert_allclose(table.channels[0], aligned, rtol=1e-8, atol=1e-9)
    for back in (sound, table):
        again = sl.signal_lag(first, back.channels[0])
        assert (again.lag, again.verdict) == (0, "sure")


def test_what_no_file_can_hold_is_refused(tmp_path: Path) -> None:
    for rate in (0.5, 1e9):
        with pytest.raises(ValueError, match=r"a WAV file holds 1 to 500,000,000 samples a second"):
            aligned_file(".wav", *apart(0), 0, rate)
    with pytest.raises(ValueError, match=r"has 1,100,000,000 samples; a WAV file holds"):
        check_wav(1_100_000_000, 8000.0)
    unrelated = np.random.default_rng(1).normal(size=(2, 3000))
    for suffix in (".wav", ".csv"):
        path = tmp_path / f"out{suffix}"
        with pytest.raises(ValueError, match=r"'nothing' \(chance\)"):
            write_aligned(path, suffix, *unrelated, sl.signal_lag(*unrelated), 8000.0)
        assert not path.exists()


OVER_TIME = {
    "2,777 samples later at the start, 2,833 at the end (+136.0 ± 0.1 ppm)": [(0, 411_765, 2777.0, 136e-6)],
    "2 samples earlier at the start, 5 later at the end (+70.0 ± 0.1 ppm)": [(0, 100_000, -2.0, 70e-6)],
    "800 samples later until 12.0 s, then 400: 0.05 s are missing in recording 2": [
        (0, 96_000, 800.0, 0.0),
        (96_000, 200_000, 400.0, 0.0),
    ],
    "0 samples later until 1.0 s, then 8 earlier, 16 from 2.0 s on, 8 from 3.0 s on and 1 more: "
    "0.001 s are missing in recording 1 and 0.003 s are missing in recording 2": [
        (0, 8_000, 0.0, 0.0),
        (8_000, 16_000, -8.0, 0.0),
        (16_000, 24_000, -16.0, 0.0),
        (24_000, 32_000, -8.0, 0.0),
        (32_000, 40_000, -16.0, 0.0),
    ],
}


@pytest.mark.parametrize("said", OVER_TIME)
def test_the_lag_over_time_in_words(said: str) -> None:
    lines = tuple(Stretch(*line, slope_error=1e-9) for line in OVER_TIME[said])
    assert over_time_in_words(LagOverTime(lines), 8000.0) == said


def test_the_figures_hold_the_lag_over_time_every_arrival_and_what_was_assumed() -> None:
    first, second = apart(300, 60_000)
    echo = np.delete(second, slice(30_000, 30_400))
    echo[500:] += 0.4 * echo[:-500]
    figures = json.loads(lag_json(sl.signal_lag(first, echo, sampling_rate=8000.0), LagSearch(), {"speed"}))
    (step,) = figures["over_time"]["steps"]
    assert step["time_s"] == pytest.approx(29_700 / 8000, abs=0.01)
    assert (step["before"], step["after"], step["missing_in_recording_2"]) == pytest.approx((300, -100, 400), abs=0.1)
    assert figures["over_time"]["ppm"] == figures["drift_ppm"] == pytest.approx(0, abs=2)
    assert [round(one["lag_samples"]) % 400 for one in figures["arrivals"]][:2] == [300, 0]
    assert figures["arrivals"][0]["sigma"] > figures["arrivals"][1]["sigma"] > 6
    assert figures["assumed"] == {"speed": 333.0}


LAG_SEARCHES = [
    LagSearch(),
    LagSearch(method="phat", sampling_rate=8000.0, speed=1497.3, max_lag=500),
    LagSearch(method="sampled", sampling_rate=0.1 + 0.2),
]


@pytest.fixture
def recordings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, signal in zip(("first.npy", "second.npy"), apart(123), strict=True):
        (tmp_path / name).write_bytes(npy(signal))
    return tmp_path


@pytest.mark.parametrize("search", LAG_SEARCHES, ids=str)
def test_the_lag_command_says_what_the_file_says(search: LagSearch, recordings: Path, ran: Command) -> None:
    command = shlex.split(lag_command(search, "first.npy", "second.npy"))
    assert command[0] == "stereolag"
    told = without_time(ran(*command[1:], "--json").out)
    assert told == without_time(lag_json(measured(123, search), search))
    assert told["lag_samples"] == 123
    assert told["settings"] == search.model_dump()


class MarkedSearch(LagSearch):
    """A search with a boolean setting."""

    marked: bool = Field(default=False, title="Marked", description="Whether it is.")


@pytest.mark.parametrize("marked", [False, True])
def test_a_setting_that_is_yes_or_no_is_a_flag_the_command_knows(marked: bool) -> None:
    search = MarkedSearch(marked=marked)
    parser = CommandParser("lag", "A search that may be marked.", "FIRST SECOND")
    parser.add_argument("files", nargs=2)
    flags = SettingsFlags(parser, MarkedSearch(marked=not marked))
    _, settings = flags.parsed(shlex.split(lag_command(search, "first.npy", "second.npy"))[2:])
    assert settings == search


@pytest.fixture
def pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with an image and a template that occurs in it twice, spoilt where its mask is 0."""
    monkeypatch.chdir(tmp_path)
    image = np.random.default_rng(0).integers(0, 255, (90, 120, 3), dtype=np.uint8)
    image[60:80, 70:100] = image[20:40, 30:60]
    template, mask = image[20:40, 30:60].copy(), np.full((20, 30), 255, np.uint8)
    template[:, :10], mask[:, :10] = 0, 0
    for name, picture in (("image.png", image), ("template.png", template), ("mask.png", mask)):
        (tmp_path / name).write_bytes(image_png(picture))
    return tmp_path


def found(query: TemplateQuery) -> sl.TemplateSearch:
    image, template, mask = (sl.read_image(f"{name}.png") for name in ("image", "template", "mask"))
    return sl.match_template(image, template, mask=mask, **query.arguments, seed=0)


QUERIES = [
    TemplateQuery(max_matches=3),
    TemplateQuery(method="direct", min_score=0.95, max_matches=2),
    TemplateQuery(method="sampled"),  # two places fit equally well
    TemplateQuery(max_matches=1),  # likewise
    TemplateQuery(max_matches=2, min_scale=0.95, max_rotation=2.0),
]


def as_told(match: sl.TemplateMatch) -> dict[str, Any]:
    """Return a match as JSON gives it back."""
    told: dict[str, Any] = json.loads(json.dumps(asdict(match)))
    return told


@pytest.mark.parametrize("query", QUERIES, ids=str)
def test_the_find_command_says_what_the_file_says_and_the_matches_come_back(query, pictures, ran):
    command = shlex.split(find_command(query, "image.png", "template.png", "mask.png"))
    told = without_time(ran(*command[1:], "--json").out)
    result = found(query)
    assert [image["file"] for image in told.pop("images")][:2] == ["image.png", "template.png"]
    assert told == without_time(matches_json(result, query))
    assert told["found"] == (query not in QUERIES[2:4])
    assert told["matches"] == [as_told(match) for match in result.matches]
    assert told["settings"] == query.model_dump()
    lines = [*csv.DictReader(io.StringIO(matches_csv(result)))]
    kinds: dict[str, Callable[[str], Any]] = {
        field.name: {"int": int, "float": float, "float | None": float}.get(str(field.type), str)
        for field in fields(sl.TemplateMatch)
    }
    assert [int(line.pop("clear")) for line in lines] == [1] * result.clear + [0] * (len(lines) - result.clear)
    back = [{name: kinds[name](text) for name, text in line.items()} for line in lines]
    assert back == [
        {name: value for name, value in as_told(match).items() if not isinstance(value, list)}
        for match in result.matches
    ]
    assert matches_csv(replace(result, matches=[])) == matches_csv(result).splitlines()[0] + "\n"


def test_whatever_else_a_search_comes_to_tell_is_in_its_figures() -> None:
    @dataclass(frozen=True)
    class Further(sl.TemplateSearch):
        others: tuple[sl.TemplateMatch, ...] = ()
        lead: float = 0.0

    match = sl.TemplateMatch(1, 2, 3, 4, 0.5)
    scores = np.zeros((2, 2), np.float32)
    result = Further([match], scores, 4, 0.1, match, [match], 0, "look_alikes", 0.0, (match,), float("nan"))
    figures = json.loads(matches_json(result, TemplateQuery()))
    assert figures["rivals"] == figures["others"] == [as_told(match)]
    assert (figures["best"], figures["lead"]) == (as_told(match), None)
    assert (figures["found"], figures["reason"], figures["clear"]) == (False, "look_alikes", 0)
    assert "score_map" not in search_figures(result, TemplateQuery())


def by_script(program: str, folder: Path) -> str:
    (folder / "reproduce.py").write_text(program, encoding="utf-8")
    return run_program(folder / "reproduce.py")


def test_the_lag_program_measures_it_again(recordings: Path) -> None:
    search = LagSearch(method="phat", sampling_rate=8000.0, max_lag=500)
    said = by_script(lag_script(search, "x/first.npy", "second.npy"), recordings)
    assert said == f"lag 123 samples, 0.015375 s, score {measured(123, search).score:.3f}: sure\n"


def test_the_find_program_finds_it_again_or_says_why_not(pictures: Path) -> None:
    def said(mask: str | None, **settings: Any) -> list[str]:
        query = TemplateQuery(**settings)
        return by_script(find_script(query, "image.png", "template.png", mask), pictures).splitlines()

    query = {"max_matches": 3, "min_score": 0.5}
    first, second = said("mask.png", **query)
    score = found(TemplateQuery(**query)).matches[0].score
    assert first.startswith(f"row 20, column 30, score {score:.3f}")
    assert second.startswith("row 60, column 70, score ")
    assert said(None, **query) == ["Not found: look_alikes"]
    nothing = said("mask.png", min_scale=0.95, max_rotation=2.0, max_matches=1)
    assert nothing == ["Not found: look_alikes"]


def test_metrics_come_back_from_the_table_and_coverage_and_time_need_no_ground_truth() -> None:
    truth = np.array([[1.0, 2.0, 3.0, 40.0]])
    found = sl.evaluate([[1.0, 2.75, np.nan, 44.0]], truth)
    nothing = sl.evaluate(np.full((1, 4), np.nan), truth, thresholds=(3.0,))
    images = np.random.default_rng(0).integers(0, 255, (2, 40, 90), dtype=np.uint8)
    map_of_bm = sl.StereoBM(num_disparities=16, block_size=9).compute(*images)
    table = metrics_csv({"BM, 21 px": found, "none": nothing}, {"BM": map_of_bm}, {"BM": 12.5})
    rows = list(csv.DictReader(io.StringIO(table)))
    assert [row["method"] for row in rows] == ["BM, 21 px", "none", "BM"]
    first = "method truth_pixels density epe_px d1_all_percent bad_0.5_percent bad_1_percent"
    assert list(rows[0])[:7] == first.split()
    assert float(rows[0]["epe_px"]) == found.epe
    assert float(rows[0]["density"]) == 0.75
    assert float(rows[0]["bad_0.5_percent"]) == found.bad[0.5] == 75
    assert float(rows[0]["bad_measured_4_percent"]) == found.bad_measured[4.0]
    assert rows[0]["bad_3_percent"] == rows[1]["epe_px"] == rows[1]["bad_measured_3_percent"] == ""
    assert float(rows[1]["bad_3_percent"]) == float(rows[1]["d1_all_percent"]) == 100
    assert float(rows[2]["coverage"]) == map_of_bm.coverage
    assert float(rows[2]["elapsed_s"]) == map_of_bm.elapsed_s
    assert float(rows[2]["estimated_bad_2_percent"]) == 12.5
    assert rows[2]["epe_px"] == rows[0]["coverage"] == ""
