"""Files of the lag page and the template search: all are offered and correct, and none is made before it is needed."""

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stereolag as sl
from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.ui import downloads
from stereolag.ui.downloads import File, archive
from stereolag.ui.lag import parts as lag_files
from stereolag.ui.lag.inputs import RecordingPair
from stereolag.ui.search import parts as match_files
from stereolag.ui.search.inputs import PictureAndTemplate
from tests.app.pages import FIND, LAG, open_page
from tests.app.reading import captions
from tests.app.uploads import noise, texture
from tests.programs import run_program


def recordings() -> RecordingPair:
    """Return recordings of different sizes from the examples', 123 samples apart."""
    sound = noise(4123)
    return RecordingPair("Noise.", "noise", False, 1000 * sound[123:] + 40, sound[:3900], 8000.0, None)


def lag_of(pair: RecordingPair, search: LagSearch) -> sl.SignalLag:
    return sl.signal_lag(pair.signal_1, pair.signal_2, **search.model_dump(), seed=0)


def unpacked(files: list[File], folder: Path) -> dict[str, str]:
    """Unpack the ZIP into a folder; return the README's description of each file."""
    with zipfile.ZipFile(io.BytesIO(archive(files, "About."))) as whole:
        whole.extractall(folder)
    lines = (folder / downloads.README).read_text("utf-8").splitlines()
    said = dict(line.split(": ", 1) for line in lines if ": " in line)
    assert said.keys() | {downloads.README} == {path.name for path in folder.iterdir()}
    return said


def test_the_zip_of_a_lag_measures_it_again(tmp_path: Path) -> None:
    pair, search = recordings(), LagSearch(sampling_rate=8000.0)
    result = lag_of(pair, search)
    unpacked(lag_files.lag_files(pair, result, search), tmp_path)
    for name in ("aligned.wav", "aligned.csv"):
        assert sl.signal_lag(pair.signal_1, sl.read_signal(tmp_path / name).channels[0]).lag == 0
    kept = json.loads((tmp_path / "lag.json").read_text())
    assert (kept["lag_samples"], kept["assumed"]) == (123, {"speed": 333.0})
    assert run_program(tmp_path / "reproduce.py").startswith("lag 123 samples, 0.015375 s")


def test_votes_and_a_rate_that_no_wav_holds(tmp_path: Path) -> None:
    pair, search = recordings(), LagSearch(method="sampled", sampling_rate=0.25)
    sampled = replace(pair, signal_1=pair.signal_1 / 1000)
    files = lag_files.lag_files(pair, lag_of(sampled, search), search)
    assert [file.name for file in files if file.refusal] == ["aligned.wav"]
    said = unpacked(files, tmp_path)
    assert "votes" in said["votes.csv"]
    assert (tmp_path / "votes.csv").read_text().startswith("lag_samples,time_s,votes\n")


def test_only_a_sure_lag_is_undone_in_files() -> None:
    pair = replace(recordings(), signal_2=noise(3900, seed=5))
    files = lag_files.lag_files(pair, lag_of(pair, LagSearch()), LagSearch())
    refused = {file.name: file.refusal for file in files if file.refusal}
    assert refused == dict.fromkeys(("aligned.wav", "aligned.csv"), "Only a reliable lag can be undone.")


def test_of_a_long_curve_the_part_around_the_lag_is_kept_and_a_reduced_one_is_called_so(monkeypatch):
    pair, search = recordings(), LagSearch()
    result = lag_of(pair, search)
    reduced = replace(result, lags=result.lags[::10], correlation=result.correlation[::10])

    def curve_of(result: sl.SignalLag) -> File:
        return lag_files.lag_files(pair, result, search)[0]

    assert "for every lag" in curve_of(result).meaning
    assert "of each stretch" in curve_of(reduced).meaning
    monkeypatch.setattr(lag_files, "MAX_CURVE_LAGS", 1000)
    curve = curve_of(result)
    assert "the 1,000 lags around the one found" in curve.meaning
    assert len(str(curve.make()).splitlines()) == 1 + 1000


@pytest.mark.parametrize(("dtype", "masked"), [(np.uint8, False), (np.float32, True)])
def test_the_zip_of_a_search_finds_it_again(dtype: type, masked: bool, tmp_path: Path) -> None:
    picture = texture(90, 1500)[:, :, 0].astype(dtype)
    template, mask = picture[20:40, 30:60].copy(), None
    if masked:
        template[:, :10], mask = 0, np.full((20, 30, 3), 255, np.uint8)
        mask[:, :10] = 0
    inputs = PictureAndTemplate("Noise.", "noise", False, picture, template, mask)
    query = TemplateQuery(min_score=0.9)
    result = sl.match_template(picture, template, mask=mask, **query.arguments, seed=0)
    files = match_files.match_files(inputs, result, query)
    unpacked(files, tmp_path)
    framed = sl.read_image(tmp_path / "framed.png")
    assert framed.shape[:2] == picture.shape
    if dtype is np.uint8:  # framed outside the match, and nothing within is touched
        changed = np.argwhere((framed != picture[..., np.newaxis]).any(axis=2))
        assert (changed.min(axis=0) < (20, 30)).all() and (changed.max(axis=0) >= (40, 60)).all()
        np.testing.assert_array_equal(framed[23:37, 33:57, 0], picture[23:37, 33:57])
    assert len([file for file in files if not file.label]) == 2 + masked
    assert json.loads((tmp_path / "matches.json").read_text())["found"]
    if masked:
        assert run_program(tmp_path / "reproduce.py") == "row 20, column 30, score 1.000\n"
    assert (tmp_path / "matches.csv").read_text().splitlines()[1].startswith("20,30,20,30,")


@pytest.mark.parametrize("blank", [False, True])
def test_where_nothing_is_found_the_best_place_is_framed_if_there_is_one(blank: bool) -> None:
    picture = np.full((60, 80, 3), 9, np.uint8) if blank else texture(60, 80)
    inputs = PictureAndTemplate("Noise.", "noise", False, picture, texture(9, 9, seed=1))
    query = TemplateQuery(min_score=0.9)
    result = sl.match_template(inputs.picture, inputs.template, **query.arguments)
    files = {file.name: file for file in match_files.match_files(inputs, result, query)}
    assert [name for name, file in files.items() if file.refusal] == ["framed.png"] * blank
    assert len(str(files["matches.csv"].make()).splitlines()) == 1
    if not blank:
        assert (sl.read_image(io.BytesIO(bytes(files["framed.png"].make()))) != picture).any()  # type: ignore[arg-type]


OF_A_LAG = ["Curve CSV", "Result JSON", "Aligned WAV", "Aligned CSV"]
OF_A_SEARCH = ["Matches CSV", "Matches JSON", "Framed PNG"]


@pytest.mark.parametrize(("path", "part", "labels"), [(LAG, "lag", OF_A_LAG), (FIND, "template", OF_A_SEARCH)])
def test_all_is_on_offer_once_it_is_opened(path: str, part: str, labels: list[str]) -> None:
    app = open_page(path)
    assert not app.get("download_button")
    app.session_state[f"{part}.part"] = "Take away"
    buttons = app.run().get("download_button")
    assert [button.proto.label for button in buttons] == ["All in one ZIP", *labels, "Python script"]
    assert not any(button.proto.disabled for button in buttons)
    (command,) = [block.value for block in app.code if block.value.startswith("stereolag ")]
    assert "--method fft" in command
    assert any(caption.value.endswith("share or bookmark it.") for caption in app.caption)


def test_both_are_heard_alone_and_together() -> None:
    app = open_page(LAG, {"lag.part": "Listen"})
    assert len(app.get("audio")) == 4
    for said in ("both, as recorded", "both, the lag undone", "With the lag undone it comes once."):
        assert said in captions(app)


def test_a_zip_that_takes_too_much_memory_is_refused_and_nothing_is_made_unasked(monkeypatch):
    def made(*args: object, **options: object) -> bytes:
        raise AssertionError("made unasked")

    for maker in ("curve_csv", "lag_json", "aligned_file", "npy", "lag_script"):
        monkeypatch.setattr(lag_files, maker, made)
    monkeypatch.setattr(lag_files, "ZIP_BYTES_PER_SAMPLE", 10**6)
    app = open_page(LAG, {"lag.part": "Take away"})
    assert not app.error
    (disabled,) = [button.proto for button in app.get("download_button") if button.proto.disabled]
    assert disabled.label == "All in one ZIP"
    assert "one job may take" in disabled.help
    assert not app.code  # its command needs the recordings, which only the ZIP holds
