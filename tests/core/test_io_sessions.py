"""A session is read as it was written, and its odd entries are left out or refused."""

import json
from typing import Any

import numpy as np
import pytest

from stereolag import Calibration
from stereolag.io.calibrations import calibration_json
from stereolag.io.disparities import pfm
from stereolag.io.images import image_png, image_tiff
from stereolag.io.sessions import SESSION, Colours, Session, read_session, session_json
from stereolag.io.sources import bundle, read_archive
from stereolag.stereo.methods import METHODS

LEFT, RIGHT = np.random.default_rng(0).integers(0, 2**16, (2, 30, 40, 3)).astype(np.uint16)
TRUTH = np.where(LEFT[:, :, 0] > 30_000, LEFT[:, :, 0] / 7, np.nan).astype(np.float32)
CALIBRATION = Calibration(700.1, 0.1234567891, 1.5, 20.25, 14.75, width=40, height=30, num_disparities=17)
FILES = {
    "left": "left.png",
    "right": "right.png",
    "truth": "truth.pfm",
    "visible": "visible.png",
    "calibration": "calibration.json",
}


def read(**changes: Any) -> Session:
    document = json.loads(
        session_json(
            files=FILES,
            matchers=[method() for method in METHODS],
            shown=["sgm", "bm"],
            size="1/2",
            colours={"low": -3.5, "high": 40.25, "palette": "turbo", "inverted": True, "outlined": True},
            description="A desk.",
            history=["It was rectified.", "Rows were aligned."],
            num_disparities=48,
            min_disparity=-16,
        )
    )
    document |= {name: value for name, value in changes.items() if name != "pair"}
    document["pair"] |= changes.get("pair", {})
    files = {
        "left.png": image_png(LEFT),
        "right.png": image_png(RIGHT),
        "truth.pfm": pfm(TRUTH),
        "visible.png": image_png(LEFT[:, :, 1] > 9_000),
        "calibration.json": calibration_json(CALIBRATION),
        "other.tif": image_tiff(np.zeros((9, 9), np.float32)),
        SESSION: json.dumps(document),
    }
    archive = read_archive(bundle(files))
    assert SESSION in archive.names
    return read_session(archive)


def test_all_comes_back_bit_for_bit() -> None:
    found = read()
    np.testing.assert_array_equal(found.left, LEFT)
    np.testing.assert_array_equal(found.right, RIGHT)
    np.testing.assert_array_equal(found.truth, TRUTH)
    np.testing.assert_array_equal(found.visible, LEFT[:, :, 1] > 9_000)
    assert found.calibration == CALIBRATION
    assert found.matchers == tuple(method() for method in METHODS)
    saved = found.document
    assert saved.shown == ["bm", "sgm"]
    assert (saved.size, saved.pair.description) == ("1/2", "A desk.")
    assert saved.pair.history == ["It was rectified.", "Rows were aligned."]
    assert (saved.pair.min_disparity, saved.pair.num_disparities) == (-16, 48)
    assert saved.colours == Colours(low=-3.5, high=40.25, palette="turbo", inverted=True, outlined=True)


@pytest.mark.parametrize(
    ("colours", "expected"),
    [
        ({}, Colours()),
        ([], Colours()),
        ({"low": 5, "high": 5}, Colours()),
        ({"low": float("nan"), "high": 5}, Colours()),
        ({"low": "0", "high": 5, "palette": 7}, Colours()),
        ({"low": 1, "high": 1e300, "inverted": 1, "outlined": "yes"}, Colours()),
        ({"low": 0, "high": 5, "palette": "viridis"}, Colours(low=0.0, high=5.0, palette="viridis")),
    ],
)
def test_odd_colours_are_left_to_the_page(colours: object, expected: Colours) -> None:
    assert read(colours=colours).document.colours == expected


def test_no_text_is_a_command() -> None:
    evil = (
        "A ![x](http://e.org/x.png) <b>b</b> `c` $d$ :red[e] www.e.org https://e.org a@e.org\n\n# f * g _h_ "
        + "i" * 9999
    )
    saved = read(pair={"description": evil, "history": [evil, 5, None, *["x"] * 50]}, size=evil).document
    for text in (saved.pair.description, saved.pair.history[0], saved.size):
        assert not set(text) & set("![]<>`$#*_@\\\n")
        assert "://" not in text
        assert "www." not in text
        assert len(text) <= 500
    assert len(saved.pair.history) <= 20


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"pair": {"files": None}}, "does not name the left and the right image"),
        ({"pair": {"files": FILES | {"right": 5}}}, "does not name the left and the right image"),
        ({"pair": {"files": FILES | {"left": "nowhere.png"}}}, "holds no “nowhere.png”"),
        ({"pair": {"files": FILES | {"left": "other.tif"}}}, "same size"),
        ({"pair": {"files": FILES | {"left": SESSION}}}, "not an image"),
        ({"pair": {"files": FILES | {"truth": "left.png"}}}, "one channel"),
        ({"pair": {"files": FILES | {"visible": "other.tif"}}}, "another size than the left image"),
        ({"pair": {"files": FILES | {"calibration": "left.png"}}}, "calibration"),
        ({"methods": [5]}, "must be a JSON object"),
        ({"methods": [{"method": "StereoBM", "settings": {"block_size": 6}}]}, "odd sizes"),
    ],
)
def test_a_session_that_cannot_be_is_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence) as caught:
        read(**changes)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("data", [b"", b"[" * 10_000, b"5", b"null", b"\xff\xfe", b" " * 2**19])
def test_a_session_file_that_is_none_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="session file"):
        read_session(read_archive(bundle({SESSION: data})))
