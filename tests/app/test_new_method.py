"""A new stereo method is one class, listed once; a new export is one entry; everything else follows from them."""

from collections.abc import Iterator
from typing import Annotated

import cv2
import numpy as np
import pytest
from pydantic import Field

from benchmarks import accuracy
from benchmarks.pairs import TruePair
from stereolag.commands import main
from stereolag.core.inputs import Image, as_grey
from stereolag.core.jobs import Progress
from stereolag.core.settings import Applies, FitsImage, OfThePair, Pixels
from stereolag.io.programs import script
from stereolag.io.settings import read_matcher
from stereolag.stereo.matcher import PixelMatches, Reason, StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui.depth import downloads
from stereolag.ui.depth.downloads import Download, files
from stereolag.ui.downloads import File
from tests.app import keys
from tests.app.pages import DEPTH, linked, moved
from tests.app.reading import address, figures, viewers
from tests.programs import run_program


class MadeUp(StereoMatcher):
    """Block matching by the smallest sum of absolute differences: a complete method in one class."""

    title = "Made up"
    short_name = "madeup"
    first_shown = ("side", "num_disparities")

    side: Annotated[int, Pixels(), FitsImage()] = Field(default=9, title="Block side", ge=3, le=51)
    num_disparities: Annotated[int, Pixels(rounded_up=True), OfThePair()] = Field(
        default=32, title="Disparities searched", ge=1, le=512
    )
    min_disparity: int = Field(default=0, title="Smallest disparity", ge=-64, le=64)
    strict: bool = Field(default=False, title="Give no disparity at the last lag")
    slack: Annotated[int, Applies(lambda settings: settings.strict, "needs strict")] = Field(
        default=1, title="Lags that count as last", ge=1, le=8
    )

    def match(self, left: Image, right: Image, progress: Progress) -> PixelMatches:
        one, other = (as_grey(image).astype(np.float32) for image in (left, right))
        costs = np.empty((self.num_disparities, *one.shape), np.float32)
        for lag in range(self.num_disparities):
            shifted = np.roll(other, self.min_disparity + lag, axis=1)
            costs[lag] = cv2.blur(np.abs(one - shifted), (self.side, self.side))
            progress((lag + 1) / self.num_disparities)
        lag = costs.argmin(axis=0)
        last = (lag >= self.num_disparities - self.slack) & self.strict
        reason = np.where(last, Reason.AT_SEARCH_EDGE, Reason.MEASURED).astype(np.uint8)
        disparity = np.where(last, np.nan, lag + self.min_disparity).astype(np.float32)
        return PixelMatches(disparity, reason)


@pytest.fixture
def listed() -> Iterator[type[StereoMatcher]]:
    METHODS.append(MadeUp)
    yield MadeUp
    METHODS.remove(MadeUp)


@pytest.mark.usefixtures("listed")
def test_a_new_method_has_its_controls_and_its_address() -> None:
    side, slack = (keys.setting("madeup", name) for name in ("side", "slack"))
    app = linked(DEPTH, maps="madeup", madeup__side="15")
    assert app.button_group(key=keys.TAB).value == "madeup"
    assert list(figures(app)) == ["Made up"]
    assert app.slider(key=side).value == 15
    assert app.slider(key=keys.setting("madeup", "num_disparities", keys.CUBE)).value == 64
    assert not app.warning
    before = viewers(app)[0]["pictures"][0]["digest"]
    moved(app, {side: 5})
    assert viewers(app)[0]["pictures"][0]["digest"] != before
    assert address(app) == {"maps": "madeup", "madeup.side": "5"}
    app.session_state[keys.more("madeup")] = True
    app.run()
    assert app.slider(key=slack).disabled
    moved(app, {keys.setting("madeup", "strict"): True})
    assert not app.slider(key=slack).disabled
    app.button(key=keys.preset_key("reset")).click().run()


@pytest.mark.usefixtures("listed")
def test_a_new_method_joins_the_parts_below_the_maps() -> None:
    app = moved(linked(DEPTH), {keys.PART: "Scoreboard"})
    assert "Made up" in app.dataframe[0].value.index
    moved(app, {keys.PART: "Sweep"})
    moved(app, {"depth.sweep.method": "Made up"})
    assert "Block side" in app.selectbox(key="depth.sweep.MadeUp.Down").options


@pytest.mark.usefixtures("listed")
def test_a_new_method_has_its_flags_and_goes_out_as_settings_and_as_a_program(tmp_path, capsys):
    image = np.random.default_rng(1).integers(0, 255, (40, 80), dtype=np.uint8)
    pair = [str(tmp_path / f"{side}.png") for side in ("left", "right")]
    for name in pair:
        cv2.imwrite(name, image)
    flags = "--trust", "--method", "madeup", "--side", "7", "--strict"
    assert main(["depth", *pair, *flags, "--out", str(tmp_path)]) == 0
    matcher = MadeUp(side=7, strict=True)
    assert read_matcher(tmp_path / "settings.json") == matcher
    assert main(["depth", *pair, "--trust", "--settings", str(tmp_path / "settings.json"), "--json"]) == 0
    assert '"method": "MadeUp"' in capsys.readouterr().out
    (tmp_path / "disparity.npy").unlink()
    program = tmp_path / "reproduce.py"
    program.write_text(script(matcher, "left.png", "right.png"), encoding="utf-8")
    run_program(program)
    np.testing.assert_array_equal(np.load(tmp_path / "disparity.npy"), matcher.compute(image, image).disparity)


@pytest.mark.usefixtures("listed")
def test_a_new_method_is_a_column_of_the_benchmark(monkeypatch: pytest.MonkeyPatch) -> None:
    image = np.random.default_rng(2).integers(0, 255, (60, 160), dtype=np.uint8)
    pair = TruePair("shifted", "Middlebury", image[:, :-5], image[:, 5:], np.full((60, 155), 5, np.float32), 16)
    monkeypatch.setattr(accuracy, "true_pairs", lambda: iter([pair]))
    monkeypatch.setattr(accuracy, "FAMILIES", {"Middlebury": ("shifted",)})
    monkeypatch.setattr(accuracy, "merit", lambda figures, ratio: 0.0)
    table, values = accuracy.accuracy_tables()
    assert "| Made up |" in table
    assert values["pairs"]["shifted"]["maps"]["Made up"]["bad"] < 20  # type: ignore[index]


def test_a_new_export_is_a_button_and_in_the_archive(monkeypatch: pytest.MonkeyPatch) -> None:
    def with_mean(download: Download) -> list[File]:
        mean = File("Mean", "mean.txt", lambda: f"{np.nanmean(download.result.disparity):.3f}\n", "")
        return [*files(download), mean]

    monkeypatch.setattr(downloads, "files", with_mean)
    app = linked(DEPTH)
    app.session_state["depth.take.opened"] = True
    app.run()
    assert "depth.take.mean.txt" in [button.key for button in app.get("download_button")]
