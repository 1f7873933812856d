"""One ZIP with everything, including the scoreboard."""

from __future__ import annotations

import csv
import io
import zipfile

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from stereolag import Evaluation, StereoBM, evaluate, read_disparity
from stereolag.io.archive_writing import bundle, file_name
from stereolag.io.disparities import image_png, kitti_png, pfm
from stereolag.io.results import metrics_csv

names = st.dictionaries(st.text(max_size=300), st.binary(max_size=50), min_size=1, max_size=4)


def test_what_goes_in_comes_out_for_other_readers():
    disparity = np.array([[1.5, 2.25], [np.nan, 8.0]], dtype=np.float32)
    picture = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    data = bundle({"disparity.pfm": pfm(disparity), "kitti.png": kitti_png(disparity), "left.png": image_png(picture)})
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == ["disparity.pfm", "kitti.png", "left.png"]
        np.testing.assert_array_equal(read_disparity(archive.read("disparity.pfm")), disparity)
        kitti = cv2.imdecode(np.frombuffer(archive.read("kitti.png"), np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(kitti, [[384, 576], [0, 2048]])
        np.testing.assert_array_equal(np.array(Image.open(archive.open("left.png"))), picture)


def test_equal_files_make_equal_archives():
    files = {"a.txt": b"a" * 1000, "b.npy": bytes(range(256))}
    assert bundle(files) == bundle(dict(files))
    assert len(bundle(files)) < 1000


@given(names)
def test_any_names_give_harmless_ones_with_their_bytes(files):
    try:
        data = bundle(files)
    except ValueError as error:
        assert "several that become" in str(error)
        return
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.namelist() == [file_name(name) for name in files]
        assert [archive.read(name) for name in archive.namelist()] == list(files.values())


@given(st.text(max_size=300))
def test_a_file_name_is_harmless_and_stays_so(name):
    safe = file_name(name)
    assert safe
    assert len(safe.encode()) <= 255
    assert not set(safe) & set('/\\:*?"<>|[]()`#! \n\0')
    assert safe[0] not in "-._"
    assert safe[-1] not in "."


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("disparity_map-2.pfm", "disparity_map-2.pfm"),
        ("../../etc/passwd", "passwd"),
        ("C:\\users\\me\\left.png", "left.png"),
        ("**bold** [x](http://y).png", "y-.png"),
        ("links – Kopie (2).PNG", "links-Kopie-2-.PNG"),
        ("Größe.png", "Größe.png"),
        ("..", "file"),
        ("", "file"),
        ("con.txt", "file-con.txt"),
        (".hidden", "hidden"),
        ("x" * 300 + ".png", "x" * 50 + ".png"),
    ],
)
def test_file_names(name, expected):
    assert file_name(name) == expected


@pytest.mark.parametrize("files", [{"a/x.png": b"", "b/x.png": b""}, {"A.png": b"", "a.PNG": b""}])
def test_two_files_of_one_name_are_refused(files):
    with pytest.raises(ValueError, match=r"several that become (x\.png|A\.png, a\.PNG);"):
        bundle(files)


def test_an_empty_archive_is_refused():
    with pytest.raises(ValueError, match="empty"):
        bundle({})


def test_metrics_come_back_from_the_table():
    truth = np.array([[1.0, 2.0, 3.0, 40.0]])
    found = evaluate([[1.0, 2.75, np.nan, 44.0]], truth)
    nothing = evaluate(np.full((1, 4), np.nan), truth, thresholds=(3.0,))
    rows = list(csv.DictReader(io.StringIO(metrics_csv({"BM, 21 px": found, "none": nothing}))))
    assert [row["method"] for row in rows] == ["BM, 21 px", "none"]
    assert list(rows[0])[:7] == [
        "method",
        "truth_pixels",
        "density",
        "epe_px",
        "d1_all_percent",
        "bad_0.5_percent",
        "bad_1_percent",
    ]
    assert float(rows[0]["epe_px"]) == found.epe
    assert float(rows[0]["density"]) == 0.75
    assert float(rows[0]["bad_0.5_percent"]) == found.bad[0.5] == 75
    assert float(rows[0]["bad_measured_4_percent"]) == found.bad_measured[4.0]
    assert rows[0]["bad_3_percent"] == rows[1]["epe_px"] == rows[1]["bad_measured_3_percent"] == ""
    assert float(rows[1]["bad_3_percent"]) == float(rows[1]["d1_all_percent"]) == 100


def test_a_table_without_methods_has_its_heading():
    assert metrics_csv({}) == "method,truth_pixels,density,epe_px,d1_all_percent\n"


def test_evaluations_are_named_by_the_mapping():
    evaluation = Evaluation(1.0, 0.0, {}, {}, 0.0, 4)
    assert metrics_csv({"a": evaluation}).splitlines()[1] == "a,4,1.0,0.0,0.0"


def test_coverage_and_time_need_no_ground_truth():
    images = np.random.default_rng(0).integers(0, 255, (2, 40, 90), dtype=np.uint8)
    maps = {"BM": StereoBM(num_disparities=16, block_size=9).compute(*images)}
    truth = evaluate([[1.0]], [[1.0]])
    rows = list(csv.DictReader(io.StringIO(metrics_csv({"BM (non-occluded)": truth}, maps, {"BM": 12.5}))))
    assert [row["method"] for row in rows] == ["BM (non-occluded)", "BM"]
    assert float(rows[1]["coverage"]) == float(rows[1]["measured"]) == maps["BM"].coverage
    assert float(rows[1]["elapsed_s"]) == maps["BM"].elapsed_s
    assert float(rows[1]["estimated_bad_2_percent"]) == 12.5
    assert rows[1]["epe_px"] == rows[0]["coverage"] == ""
