"""Exported programs make the same maps bit for bit, and files of settings the same matcher, also in OpenCV."""

import ast
import json
from functools import partial
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pairs import shifted_pair
from pydantic import Field

import stereolag as sl
from stereolag import CorrelationMatcher, SearchArea, SemiGlobalMatcher, StereoBM, StereoSGBM
from stereolag.core.settings import Settings
from stereolag.io.images import image_png, image_tiff
from stereolag.io.programs import constructor, imports, opencv_script, script
from stereolag.io.settings import opencv_yaml, read_matcher, write_matcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.opencv import BlockMatcher
from stereolag.version import VERSION
from tests.programs import run_program, run_program_alone

RECTIFIED = sl.CorrelationMatcher(window_size=11, overlap=0.8, search=sl.SearchArea.rectified(24), score="zncc")


class Smoothing(Settings):
    """A nested stage, as in the settings of some future method."""

    kind: Literal["smoothing"] = "smoothing"
    strength: float = 0.5
    label: str = "so'so"


class Stages(Settings):
    """Settings with every kind of value."""

    nothing: None = None
    flag: bool = True
    pair: tuple[int, int] = (1, 2)
    one: tuple[Smoothing, ...] = (Smoothing(),)
    many: list[Smoothing] = Field(default_factory=lambda: [Smoothing(strength=1e-9)] * 3)


@pytest.mark.parametrize(
    ("matcher", "run"),
    [
        (RECTIFIED, run_program_alone),
        (sl.CorrelationMatcher(overlap=0.9, search=sl.SearchArea.centred(36, vertical=2)), run_program),
    ],
    ids=["rectified, in its own process", "centred"],
)
def test_the_program_measures_the_same_again(matcher, run, tmp_path):
    left, right = (np.stack([image, image // 2, 255 - image], axis=-1) for image in shifted_pair(80, 120, 0, -5.3))
    names = "left image (1).png", 'right\'s "eye" – µ.png'
    for name, image in zip(names, (left, right), strict=True):
        (tmp_path / name).write_bytes(image_png(image))
    expected = matcher.compute(left, right).disparity
    assert np.isfinite(expected).mean() > 0.3
    (tmp_path / "program.py").write_text(script(matcher, *names), encoding="utf-8")
    assert "of the pixels are measured" in run(tmp_path / "program.py")
    saved = np.load(tmp_path / "disparity.npy")
    assert saved.dtype == np.float32
    assert saved.tobytes() == expected.tobytes()
    np.testing.assert_array_equal(sl.read_disparity(tmp_path / "disparity.pfm"), expected)


def test_the_program_reads_well():
    program = script(RECTIFIED, "left.png", "right.png")
    assert "cv2" not in program
    assert max(map(len, program.splitlines())) <= 120
    assert program.endswith("\n")


PROGRAMS = {"sl.read_image": partial(script, RECTIFIED), "grey_image": partial(opencv_script, sl.StereoBM())}


@pytest.mark.parametrize("reader", PROGRAMS)
@given(st.text(), st.text())
def test_a_file_name_is_never_code_nor_a_folder(reader, left_name, right_name):
    tree = ast.parse(PROGRAMS[reader](left_name, right_name).encode())
    read = [node.args[0] for node in ast.walk(tree) if isinstance(node, ast.Call) and ast.unparse(node.func) == reader]
    names = [ast.literal_eval(one.right if isinstance(one, ast.BinOp) else one) for one in read]
    assert names == [name.replace("\\", "/").split("/")[-1] for name in (left_name, right_name)]


@pytest.mark.parametrize("settings", [Stages(), Smoothing(), sl.CorrelationMatcher(), sl.StereoSGBM()], ids=repr)
@pytest.mark.parametrize("before", ["", "x" * 60 + " = "])
def test_constructors_make_equal_settings(settings, before):
    text = constructor(settings, before=before)
    assert text.startswith(before)
    assert "kind=" not in text
    known: dict[str, object] = {"sl": sl, "Stages": Stages, "Smoothing": Smoothing}
    for line in imports(settings):
        if "stereolag" in line:
            exec(line, known)
    assert eval(text.removeprefix(before), known) == settings


def test_nested_settings_are_broken_into_lines_only_where_they_must():
    assert constructor(Stages(many=[]), before="stages = ").splitlines() == [
        "stages = Stages(",
        "    flag=True,",
        "    pair=(1, 2),",
        '    one=(Smoothing(strength=0.5, label="so\'so"),),',
        "    many=[],",
        ")",
    ]
    assert constructor(Smoothing()) == 'Smoothing(strength=0.5, label="so\'so")'


def test_imports_name_each_class_once_and_none_of_the_public_ones():
    assert imports(RECTIFIED) == ["from stereolag.stereo.windows.search import RectifiedSearch"]
    assert imports(sl.StereoBM()) == []
    assert imports(Stages()) == [f"from {__name__} import Smoothing, Stages"]


MODE = "STEREO_SGBM_MODE_"
MODES = [name for name in dir(cv2) if name.startswith(MODE)]
BM_ALL_SET = sl.StereoBM(
    num_disparities=32,
    min_disparity=-3,
    block_size=7,
    uniqueness_ratio=5,
    speckle_window_size=20,
    speckle_range=4,
    disp12_max_diff=2,
    pre_filter_cap=20,
    texture_threshold=30,
)


@pytest.mark.parametrize(
    ("matcher", "kind"),
    [
        (sl.StereoBM(num_disparities=16, block_size=9), "grey"),
        (BM_ALL_SET, "colour"),
        (sl.StereoSGBM(num_disparities=16, min_disparity=2, disp12_max_diff=-1), "transparent"),
        (sl.StereoSGBM(num_disparities=16, mode="hh", p1=8, p2=90, pre_filter_cap=31), "deep"),
        (sl.StereoBM(num_disparities=16, block_size=11, min_disparity=2), "grey"),
        (sl.StereoSGBM(num_disparities=16, mode="hh"), "raw"),
        *((sl.StereoSGBM(num_disparities=16, mode=name.removeprefix(MODE).lower()), "float") for name in MODES),
    ],
    ids=str,
)
def test_the_program_of_opencv_alone_measures_the_same(matcher: BlockMatcher, kind: str, tmp_path: Path) -> None:
    left, right = (made_of(image, kind) for image in shifted_pair(80, 120, 0, -5.3))
    ending, written = ("tif", image_tiff) if kind == "float" else ("png", image_png)
    for side, image in (("left", left), ("right", right)):
        (tmp_path / f"{side}.{ending}").write_bytes(written(image))
    program = opencv_script(matcher, f"left.{ending}", f"right.{ending}", (left, right))
    assert "import stereolag" not in program
    assert max(map(len, program.splitlines())) <= 120
    (tmp_path / "opencv.py").write_text(program, encoding="utf-8")
    run_program(tmp_path / "opencv.py")
    found, expected = np.load(tmp_path / "disparity.npy"), matcher.compute(left, right).disparity
    assert found.dtype == expected.dtype
    assert np.isfinite(expected).mean() > 0.3
    np.testing.assert_array_equal(found, expected)


def made_of(image: np.ndarray, kind: str) -> np.ndarray:
    """Return an 8-bit grey image as another kind of image."""
    colour = np.stack([image, image // 2, 255 - image], axis=-1)
    match kind:
        case "colour":
            return colour
        case "transparent":
            return np.concatenate([colour, np.full((*image.shape, 1), 200, np.uint8)], axis=-1)
        case "deep":
            return colour.astype(np.uint16) * 14 + 1000
        case "raw":
            return np.asarray(colour.astype(np.uint16) ** 2 // 16 + 300, dtype=np.uint16)
        case "float":
            return image.astype(np.float32) * 0.37
    return image


# Settings of every method: round trips as JSON, and transfer to OpenCV's own objects.

MATCHERS = [
    *(method() for method in METHODS),
    CorrelationMatcher(window_size=31, overlap=0.1, search=SearchArea.rectified(100, -7, 2), score="ncc"),
    CorrelationMatcher(search=SearchArea.centred(51, vertical=0), engine="fft"),
    SemiGlobalMatcher(window_size=7, num_disparities=48, min_disparity=-3),
    CorrelationMatcher(overlap=0.1 + 0.2),
    StereoBM(num_disparities=128, min_disparity=-16, block_size=9, uniqueness_ratio=3, texture_threshold=500),
    StereoBM(speckle_window_size=50, speckle_range=32, disp12_max_diff=2, pre_filter_cap=5),
    StereoSGBM(min_disparity=4, block_size=3, p1=72, p2=288, pre_filter_cap=63, disp12_max_diff=-1),
]
BLOCK_MATCHERS = [matcher for matcher in MATCHERS if isinstance(matcher, BlockMatcher)]


@pytest.mark.parametrize("matcher", MATCHERS, ids=repr)
def test_a_file_names_the_version_and_makes_the_same_matcher_again(matcher, tmp_path):
    write_matcher(tmp_path / "matcher.json", matcher)
    assert json.loads((tmp_path / "matcher.json").read_bytes())["stereolag"] == VERSION
    back = read_matcher(tmp_path / "matcher.json")
    assert type(back) is type(matcher)
    assert back == matcher


def test_settings_left_out_keep_their_defaults():
    assert read_matcher(b'\xef\xbb\xbf{"method": "StereoBM", "settings": {"block_size": 7}}') == StereoBM(block_size=7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "empty"),
        (b'{"method": "Stereo*BM*", "settings": {}}', r"“Stereo\?BM\?”; known are CorrelationMatcher, StereoBM"),
        (b'{"method": "StereoBM", "settings": {"block_size": 8}}', "block_size is 8; allowed are odd"),
        (b'{"method": "StereoSGBM", "settings": {"p1": 9, "p2": 9}}', "p2 > p1"),
        (
            b'{"method": "CorrelationMatcher", "settings": {"search": {"kind": "<b>"}}}',
            r"search.kind is '\?b>'; allowed are 'centred', 'rectified'",
        ),
    ],
)
def test_bad_settings_are_refused_in_one_harmless_sentence(text, message):
    with pytest.raises(ValueError, match=message) as refused:
        read_matcher(text)
    assert "\n" not in str(refused.value)
    assert not set("*[]<`") & set(str(refused.value))


@pytest.mark.parametrize("matcher", BLOCK_MATCHERS, ids=repr)
def test_the_yaml_is_what_opencv_saves_itself(matcher, tmp_path):
    matcher.opencv_matcher().save(str(tmp_path / "opencv.yml"))
    theirs = (tmp_path / "opencv.yml").read_text(encoding="utf-8")
    assert opencv_yaml(matcher) == theirs.replace("my_object:", f"{type(matcher).__name__}:")
