"""Files written to disk: read back unchanged, and never half written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from stereolag.io.disparities import DISPARITY_FORMATS, read_disparity, write_disparity
from stereolag.io.settings import read_matcher, write_matcher
from stereolag.stereo.methods import METHODS

QUANTUM = 1 / 256
MAPS = arrays(
    np.float32,
    array_shapes(min_dims=2, max_dims=2, max_side=9),
    elements=st.one_of(st.just(float("nan")), st.floats(QUANTUM, 255.75, width=32)),
)


@pytest.mark.parametrize("suffix", [*DISPARITY_FORMATS, ".PNG"])
@given(disparity=MAPS.filter(lambda one: bool(np.isfinite(one).any())))
def test_a_disparity_map_comes_back(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, disparity: npt.NDArray[np.float32]
) -> None:
    path = tmp_path_factory.getbasetemp() / f"disparity{suffix}"
    write_disparity(path, disparity)
    back = read_disparity(path)
    assert back.dtype == np.float32
    np.testing.assert_allclose(back, disparity, atol=QUANTUM / 2 if suffix.lower() == ".png" else 0, rtol=0)


def test_floats_hold_what_a_png_cannot(tmp_path: Path) -> None:
    disparity = np.array([[-40.25, 300.5], [np.inf, 0.0]])
    for suffix in (".pfm", ".npy"):
        write_disparity(tmp_path / f"wide{suffix}", disparity)
        np.testing.assert_array_equal(read_disparity(tmp_path / f"wide{suffix}"), [[-40.25, 300.5], [np.nan, 0.0]])
    with pytest.raises(ValueError, match=r"from -40.25 to 300.50 px; KITTI's PNG holds 0 to 255.99"):
        write_disparity(tmp_path / "wide.png", disparity)
    assert not (tmp_path / "wide.png").exists()


@pytest.mark.parametrize("name", ["map.tiff", "map", "map.npz"])
def test_another_suffix_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match=r"path ends in '.*'; a disparity map is written as .pfm, .npy, .png"):
        write_disparity(tmp_path / name, np.ones((2, 2)))


@pytest.mark.parametrize("suffix", DISPARITY_FORMATS)
@pytest.mark.parametrize("disparity", [np.ones(3), np.ones((2, 2, 3)), np.ones((0, 4))])
def test_anything_but_a_map_is_refused(tmp_path: Path, suffix: str, disparity: npt.NDArray[np.float64]) -> None:
    with pytest.raises(ValueError, match=r"disparity has shape .*allowed is \(rows, cols\)"):
        write_disparity(tmp_path / f"map{suffix}", disparity)


def test_a_failure_leaves_the_file_that_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "map.pfm"
    write_disparity(path, np.full((2, 2), 7.0))

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        write_disparity(path, np.full((2, 2), 9.0))
    assert (read_disparity(path) == 7).all()
    assert [*tmp_path.iterdir()] == [path]


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        write_disparity(tmp_path / "nowhere" / "map.npy", np.ones((2, 2)))


@pytest.mark.parametrize("method", METHODS)
def test_a_matcher_comes_back(tmp_path: Path, method: type) -> None:
    path = tmp_path / "matcher.json"
    write_matcher(path, method())
    assert read_matcher(path) == method()
