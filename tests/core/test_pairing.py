"""Files that belong together are found by their names."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stereolag.io.pairing import PairFiles, matched_pairs, natural_order

KITTI_2015 = "training/image_2/{0}.png training/image_3/{0}.png {1} training/calib_cam_to_cam/{2}.txt"
FOLDS: dict[str, tuple[list[str], str]] = {
    "left and right": (["left.png right.png -"], ""),
    "OpenCV's chessboards": ([f"left{n}.jpg right{n}.jpg -" for n in ("01", "02", "10")], "left03.jpg"),
    "L and R": (["L2.bmp R2.bmp -", "scene_L.png scene_R.png -"], ""),
    "capitals within": (["imageLeft1.png imageRight1.png -"], ""),
    "learned matchers and ZED": (
        ["a/left.png a/right.png - a/K.txt", "b/left.png b/right.png - b/SN1234.conf"],
        "b/notes.txt",
    ),
    "Cityscapes": (["leftImg8bit/ulm_0_9.png rightImg8bit/ulm_0_9.png -"], ""),
    "folders": ([f"set/left/{n}.png set/right/{n}.png - set/calib.yml" for n in ("000", "001")], ""),
    "Middlebury 2014": (
        [f"{n}/im0.png {n}/im1.png {n}/disp0.pfm {n}/calib.txt" for n in ("Adirondack", "Pipes")],
        "Adirondack/disp1.pfm Pipes/disp1.pfm",
    ),
    "Middlebury 2003": (["teddy/im2.png teddy/im6.png teddy/disp2.png"], "teddy/disp6.png"),
    "Middlebury 2006": (["Aloe/view1.png Aloe/view5.png Aloe/disp1.png"], "Aloe/disp5.png"),
    "KITTI 2015": (
        [
            KITTI_2015.format(f"00000{n}_{frame}", truth, f"00000{n}")
            for n in "01"
            for frame, truth in (("10", f"training/disp_occ_0/00000{n}_10.png"), ("11", "-"))
        ],
        "training/disp_noc_0/000000_10.png training/disp_noc_0/000001_10.png",
    ),
    "KITTI's sequences": (
        [f"image_{left}/0000{n}.png image_{left + 1}/0000{n}.png -" for left in (0, 2) for n in "01"],
        "",
    ),
    "EuRoC": (["mav0/cam0/data/14031.png mav0/cam1/data/14031.png -"], ""),
    "cameras from 1": (["cam1_5.png cam2_5.png -"], ""),
    "numbers behind": (["box_0.png box_1.png -", "desk_0.png desk_1.png -"], ""),
    "truth with the pair's name": (
        ["a_left.png a_right.png a_gt.png calib.json", "b_left.png b_right.png b_disp.pfm calib.json"],
        "",
    ),
    "data as here": (
        ["tsukuba/left.png tsukuba/right.png tsukuba/gt.pgm tsukuba/calib.json"],
        "tsukuba/mask_nonocc.png",
    ),
    "truth with the number of the left side": (
        ["im0_a.png im1_a.png disp0_a.pfm", "im0_b.png im1_b.png disp0_b.pfm"],
        "disp1_a.pfm disp1_b.pfm",
    ),
    "truth with the number that both share": (
        ["01_0.png 01_1.png 01_disp.png", "02_0.png 02_1.png 02_disp.png"],
        "02_disp_R.png",
    ),
    "number of the pair behind": (["a/01_0.png a/01_1.png a/disp_01.png", "a/02_0.png a/02_1.png a/disp_02.png"], ""),
    "capitals behind": (
        ["imL_1.png imR_1.png dispL_1.png", "imL_2.png imR_2.png dispL_2.png"],
        "dispR_1.png dispR_2.png",
    ),
    "Spring": (
        [f"l/frame_left_{n}.png l/frame_right_{n}.png d/disp1_left_{n}.npy" for n in "12"],
        "d/disp1_right_1.npy",
    ),
    "KITTI 2012": (
        [f"colored_0/{n}_10.png colored_1/{n}_10.png disp_occ/{n}_10.png" for n in "12"],
        "disp_noc/1_10.png",
    ),
    "a set without a truth beside one with": (["a/left.png a/right.png a/gt.png", "b/left.png b/right.png -"], ""),
    "OpenCV's two files": (["left01.jpg right01.jpg - extrinsics.yml intrinsics.yml"], "stereo_calib.xml"),
    "ROS's two files": (["left/0.png right/0.png - left.yaml right.yaml"], ""),
    "the side in folder and file": (["left/left_0.png right/right_0.png -"], "left/left_1.png"),
    "nothing that matches": ([], "a.png b.png leftover.png notes.txt"),
    "one side alone": ([], "left1.png left2.png right3.png"),
    "two of one side": ([], "left.png left.jpg right.png"),
}
"""The pairs of a set: left, right, truth or "-", calibrations; and its other files, which are in no pair."""


@pytest.mark.parametrize("name", FOLDS)
def test_pairs_are_matched_by_name(name: str) -> None:
    pairs, others = FOLDS[name]
    names = [name for name in dict.fromkeys(" ".join([*pairs, others]).split()) if name != "-"]
    found = matched_pairs(names)
    assert [" ".join((pair.left, pair.right, pair.truth or "-", *pair.calibrations)) for pair in found] == pairs
    assert matched_pairs(names[::-1]) == found


def test_pairs_are_called_by_what_their_names_share_and_ten_comes_after_two() -> None:
    names = ["set/left/000.png", "set/right/000.png", "x/im0.png", "x/im1.png", "left.png", "right.png"]
    assert [pair.name for pair in matched_pairs(names)] == ["pair", "set 000", "x"]
    assert [pair.name for pair in matched_pairs([f"all/{name}" for name in names[:4]])] == ["set 000", "x"]
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
