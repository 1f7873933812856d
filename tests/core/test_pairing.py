"""Files that belong together are found by their names."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.io.pairing import PairFiles, matched_pairs, natural_order

FOLDS: dict[str, tuple[str, list[str]]] = {
    "left and right": ("left.png right.png", ["left.png right.png -"]),
    "OpenCV's chessboards": (
        "left01.jpg right01.jpg left02.jpg right02.jpg left10.jpg right10.jpg left03.jpg",
        [f"left{n}.jpg right{n}.jpg -" for n in ("01", "02", "10")],
    ),
    "L and R": ("scene_L.png scene_R.png L2.bmp R2.bmp", ["L2.bmp R2.bmp -", "scene_L.png scene_R.png -"]),
    "capitals within": ("imageLeft1.png imageRight1.png", ["imageLeft1.png imageRight1.png -"]),
    "learned matchers and ZED": (
        "a/left.png a/right.png a/K.txt b/left.png b/right.png b/SN1234.conf b/notes.txt",
        ["a/left.png a/right.png - a/K.txt", "b/left.png b/right.png - b/SN1234.conf"],
    ),
    "Cityscapes": (
        "leftImg8bit/ulm_0_9.png rightImg8bit/ulm_0_9.png",
        ["leftImg8bit/ulm_0_9.png rightImg8bit/ulm_0_9.png -"],
    ),
    "folders": (
        "set/left/000.png set/left/001.png set/right/000.png set/right/001.png set/calib.yml",
        [f"set/left/{n}.png set/right/{n}.png - set/calib.yml" for n in ("000", "001")],
    ),
    "Middlebury 2014": (
        " ".join(f"{n}/im0.png {n}/im1.png {n}/disp0.pfm {n}/disp1.pfm {n}/calib.txt" for n in ("Adirondack", "Pipes")),
        [f"{n}/im0.png {n}/im1.png {n}/disp0.pfm {n}/calib.txt" for n in ("Adirondack", "Pipes")],
    ),
    "Middlebury 2003": (
        "teddy/im2.png teddy/im6.png teddy/disp2.png teddy/disp6.png",
        ["teddy/im2.png teddy/im6.png teddy/disp2.png"],
    ),
    "Middlebury 2006": (
        "Aloe/view1.png Aloe/view5.png Aloe/disp1.png Aloe/disp5.png",
        ["Aloe/view1.png Aloe/view5.png Aloe/disp1.png"],
    ),
    "KITTI 2015": (
        " ".join(
            f"training/image_2/00000{n}_10.png training/image_3/00000{n}_10.png training/image_2/00000{n}_11.png "
            f"training/image_3/00000{n}_11.png training/disp_occ_0/00000{n}_10.png training/disp_noc_0/00000{n}_10.png "
            f"training/calib_cam_to_cam/00000{n}.txt"
            for n in "01"
        ),
        [
            f"training/image_2/00000{n}_{frame}.png training/image_3/00000{n}_{frame}.png {truth} "
            f"training/calib_cam_to_cam/00000{n}.txt"
            for n in "01"
            for frame, truth in (("10", f"training/disp_occ_0/00000{n}_10.png"), ("11", "-"))
        ],
    ),
    "KITTI's sequences": (
        " ".join(f"image_{camera}/0000{n}.png" for camera in range(4) for n in "01"),
        [f"image_{left}/0000{n}.png image_{left + 1}/0000{n}.png -" for left in (0, 2) for n in "01"],
    ),
    "EuRoC": (
        "mav0/cam0/data/14031.png mav0/cam1/data/14031.png",
        ["mav0/cam0/data/14031.png mav0/cam1/data/14031.png -"],
    ),
    "cameras from 1": ("cam1_5.png cam2_5.png", ["cam1_5.png cam2_5.png -"]),
    "numbers behind": (
        "desk_0.png desk_1.png box_0.png box_1.png",
        ["box_0.png box_1.png -", "desk_0.png desk_1.png -"],
    ),
    "truth with the pair's name": (
        "a_left.png a_right.png a_gt.png b_left.png b_right.png b_disp.pfm calib.json",
        ["a_left.png a_right.png a_gt.png calib.json", "b_left.png b_right.png b_disp.pfm calib.json"],
    ),
    "data as here": (
        "tsukuba/left.png tsukuba/right.png tsukuba/gt.pgm tsukuba/mask_nonocc.png tsukuba/calib.json",
        ["tsukuba/left.png tsukuba/right.png tsukuba/gt.pgm tsukuba/calib.json"],
    ),
    "a set without a truth beside one with": (
        "a/left.png a/right.png a/gt.png b/left.png b/right.png",
        ["a/left.png a/right.png a/gt.png", "b/left.png b/right.png -"],
    ),
    "OpenCV's two files": (
        "left01.jpg right01.jpg stereo_calib.xml intrinsics.yml extrinsics.yml",
        ["left01.jpg right01.jpg - extrinsics.yml intrinsics.yml"],
    ),
    "ROS's two files": (
        "left/0.png right/0.png left.yaml right.yaml",
        ["left/0.png right/0.png - left.yaml right.yaml"],
    ),
    "the side in folder and file": (
        "left/left_0.png right/right_0.png left/left_1.png",
        ["left/left_0.png right/right_0.png -"],
    ),
    "nothing that matches": ("a.png b.png leftover.png notes.txt", []),
    "one side alone": ("left1.png left2.png right3.png", []),
    "two of one side": ("left.png left.jpg right.png", []),
}
"""The files of a set, and its pairs: left, right, truth or "-", calibrations."""


@pytest.mark.parametrize("name", FOLDS)
def test_pairs_are_matched_by_name(name: str) -> None:
    names, expected = FOLDS[name][0].split(), FOLDS[name][1]
    found = matched_pairs(names)
    assert [" ".join((pair.left, pair.right, pair.truth or "-", *pair.calibrations)) for pair in found] == expected
    assert matched_pairs(names[::-1]) == found


def test_pairs_are_called_by_what_their_names_share() -> None:
    names = ["set/left/000.png", "set/right/000.png", "x/im0.png", "x/im1.png", "left.png", "right.png"]
    assert [pair.name for pair in matched_pairs(names)] == ["pair", "set 000", "x"]
    assert [pair.name for pair in matched_pairs([f"all/{name}" for name in names[:4]])] == ["set 000", "x"]


def test_ten_comes_after_two() -> None:
    names = [f"{side}{number}.png" for number in (10, 2, 1) for side in ("left", "right")]
    assert [pair.left for pair in matched_pairs(names)] == ["left1.png", "left2.png", "left10.png"]
    assert sorted(["a10", "a²", "a2"], key=natural_order) == ["a2", "a10", "a²"]


@given(st.lists(st.text("lrLRefthig01_2/.npgcm \0\\", max_size=20).map(lambda stem: f"{stem}.png"), unique=True))
def test_no_file_is_in_two_pairs(names: list[str]) -> None:
    pairs = matched_pairs(names)
    used = [name for pair in pairs for name in (pair.left, pair.right)]
    assert len(used) == len(set(used))
    assert set(used) <= set(names)
    assert all(isinstance(pair, PairFiles) and pair.name for pair in pairs)
