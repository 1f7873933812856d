"""Settings of every method: round trips as JSON, and transfer to OpenCV's own objects."""

from __future__ import annotations

import json

import cv2
import pytest

from stereolag import CorrelationMatcher, SearchArea, SemiGlobalMatcher, StereoBM, StereoSGBM, read_image, samples
from stereolag.io.settings import opencv_yaml, read_matcher, settings_json, write_matcher
from stereolag.stereo.methods import METHODS
from stereolag.stereo.opencv import BlockMatcher
from stereolag.version import VERSION

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


def getters(matcher: object) -> dict[str, object]:
    regions = ("getROI1", "getROI2", "getDefaultName")
    names = [name for name in dir(matcher) if name.startswith("get") and name not in regions]
    assert len(names) > 8
    return {name: getattr(matcher, name)() for name in names}


def test_files_name_the_version():
    assert json.loads(settings_json(StereoBM()))["stereolag"] == VERSION


@pytest.mark.parametrize("matcher", MATCHERS, ids=repr)
def test_a_file_makes_the_same_matcher_again(matcher, tmp_path):
    write_matcher(tmp_path / "matcher.json", matcher)
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
        (b'{"method": "StereoBM", "settings": {"block_size": 8}}', "block_size is 8; OpenCV allows odd"),
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
def test_opencv_reads_its_yaml(matcher, tmp_path):
    path = tmp_path / "matcher.yml"
    path.write_text(opencv_yaml(matcher), encoding="utf-8")
    fresh = getattr(cv2, type(matcher).__name__).create()
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    fresh.read(storage.getFirstTopLevelNode())
    assert getters(fresh) == getters(matcher.opencv_matcher())


def test_the_yaml_is_laid_out_as_opencv_saves_it(tmp_path):
    StereoBM().opencv_matcher().save(str(tmp_path / "opencv.yml"))
    theirs = (tmp_path / "opencv.yml").read_text(encoding="utf-8")
    assert opencv_yaml(StereoBM()) == theirs.replace("my_object:", "StereoBM:")


def test_opencv_with_the_yaml_measures_what_this_library_measures(tmp_path):
    pair = next(iter(samples.stereo_pairs().values()))
    left, right = (cv2.cvtColor(read_image(side), cv2.COLOR_RGB2GRAY)[:120] for side in (pair.left, pair.right))
    matcher = StereoSGBM(block_size=3, uniqueness_ratio=5)
    storage = cv2.FileStorage(opencv_yaml(matcher), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    fresh = cv2.StereoSGBM.create()
    fresh.read(storage.getNode("StereoSGBM"))
    result = matcher.compute(left, right)
    assert result.coverage > 0.3
    expected = fresh.compute(left, right)[result.valid] / 16
    assert (result.disparity[result.valid] == expected).all()
