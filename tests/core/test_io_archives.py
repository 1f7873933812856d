"""One ZIP with everything."""

from __future__ import annotations

import io
import zipfile

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from stereolag import read_disparity
from stereolag.io.archives import bundle, file_name
from stereolag.io.disparities import kitti_png, pfm
from stereolag.io.images import image_png

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
