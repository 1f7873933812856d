"""The input doctor finds what was done to a pair, finds nothing where nothing was done, and its cures work."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ailing_pairs import ILLS, turned

from stereolag.doctor.correspondences import find_correspondences
from stereolag.doctor.diagnosis import Diagnosis, diagnose, judge_range
from stereolag.doctor.findings import Ailment
from stereolag.doctor.remedies import REMEDIES, apply_remedy, exposed_alike, levelled
from stereolag.reading import read_image
from stereolag.samples import stereo_pairs

Pair = tuple[np.ndarray, np.ndarray]


def amber(diagnosis: Diagnosis) -> set[Ailment]:
    return {finding.ailment for finding in diagnosis.findings if not finding.healthy}


@pytest.fixture(scope="module", params=["road", "cube"])
def pair(request: pytest.FixtureRequest) -> Pair:
    example = stereo_pairs()[request.param]
    return read_image(example.left), read_image(example.right)


def test_a_rectified_pair_is_healthy_in_its_geometry(pair: Pair) -> None:
    diagnosis = diagnose(*pair, num_disparities=80)
    assert not amber(diagnosis) & {Ailment.SWAPPED, Ailment.ROWS, Ailment.ROTATION, Ailment.EXPOSURE, Ailment.MATCHES}
    assert abs(diagnosis.row_offset_px) < 0.3
    assert abs(diagnosis.rotation_deg) < 0.1
    assert diagnosis.scale == pytest.approx(1, abs=0.003)


def test_swapped_sides_are_caught(pair: Pair) -> None:
    assert Ailment.SWAPPED in amber(diagnose(pair[1], pair[0]))


@pytest.mark.parametrize("rows", [3, -5])
def test_a_row_offset_is_measured_and_mended(pair: Pair, rows: int) -> None:
    shifted = np.roll(pair[1], rows, axis=0)
    diagnosis = diagnose(pair[0], shifted)
    assert Ailment.ROWS in amber(diagnosis)
    assert diagnosis.row_offset_px == pytest.approx(rows, abs=0.3)
    assert abs(diagnose(pair[0], levelled(pair[0], shifted)).row_offset_px) < 0.3


@pytest.mark.parametrize(("degrees", "scale"), [(1.0, 1.0), (-2.0, 1.0), (0.0, 1.02)])
def test_rotation_and_scale_are_measured_and_mended(pair: Pair, degrees: float, scale: float) -> None:
    view = turned(pair[1], degrees, scale)
    diagnosis = diagnose(pair[0], view)
    assert Ailment.ROTATION in amber(diagnosis)
    # getRotationMatrix2D counts anticlockwise as positive, rows grow downwards.
    assert diagnosis.rotation_deg == pytest.approx(-degrees, abs=0.15)
    assert diagnosis.scale == pytest.approx(scale, abs=0.005)
    assert not amber(diagnose(pair[0], levelled(pair[0], view))) & {Ailment.ROTATION, Ailment.ROWS}


def test_a_darkened_view_is_measured_and_mended(pair: Pair) -> None:
    dark = np.rint(pair[1] * 0.6).astype(np.uint8)
    diagnosis = diagnose(pair[0], dark)
    assert Ailment.EXPOSURE in amber(diagnosis)
    assert diagnosis.gain == pytest.approx(0.6, abs=0.08)
    assert Ailment.EXPOSURE not in amber(diagnose(pair[0], exposed_alike(pair[0], dark)))


def test_the_range_is_judged_against_what_is_there(pair: Pair) -> None:
    assert Ailment.RANGE in amber(diagnose(*pair, num_disparities=16))
    roomy = diagnose(*pair, num_disparities=256)
    assert Ailment.RANGE in amber(roomy)
    assert roomy.suggested_num % 16 == 0
    again = diagnose(*pair, min_disparity=roomy.suggested_min, num_disparities=roomy.suggested_num)
    assert Ailment.RANGE not in amber(again)


def test_a_range_is_judged_without_looking_again(pair: Pair) -> None:
    diagnosis = diagnose(*pair)
    for count in (16, 64, 256):
        assert judge_range(diagnosis, 0, count) == diagnose(*pair, num_disparities=count).finding(Ailment.RANGE)
    assert judge_range(diagnose(pair[1], pair[0]), 0, 64) is None


@pytest.mark.parametrize("ailment", REMEDIES)
def test_every_remedy_cures_its_ailment_and_keeps_size_and_type(pair: Pair, ailment: Ailment) -> None:
    ill = ILLS[ailment](*pair)
    assert ailment in amber(diagnose(*ill))
    left, right = apply_remedy(*ill, ailment)
    assert ailment not in amber(diagnose(left, right))
    assert right.shape == pair[1].shape
    assert right.dtype == pair[1].dtype
    assert left is pair[0]


def test_aligned_rows_keep_the_disparities(pair: Pair) -> None:
    mended = apply_remedy(pair[0], np.roll(pair[1], 3, axis=0), Ailment.ROWS)[1]
    assert np.mean(np.abs(mended[8:-8].astype(float) - pair[1][8:-8])) < 2.5


def test_what_no_picture_cures_is_refused(pair: Pair) -> None:
    with pytest.raises(ValueError, match="ailment is texture; what can be mended is swapped, rows"):
        apply_remedy(*pair, Ailment.TEXTURE)


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (1, 3_000), (30, 200), (64, 1)])
def test_pictures_too_small_for_features_are_examined_all_the_same(shape: tuple[int, int]) -> None:
    left, right = np.random.default_rng(3).integers(0, 256, (2, *shape), dtype=np.uint8)
    assert len(find_correspondences(left, right)) == 0
    assert Ailment.MATCHES in amber(diagnose(left, right))


def test_low_texture_and_unrelated_pictures_are_said() -> None:
    flat = np.full((200, 300), 90, np.uint8)
    flat[80:120, 100:180] = np.random.default_rng(0).integers(0, 255, (40, 80))
    assert Ailment.TEXTURE in amber(diagnose(flat, flat))
    noise = np.random.default_rng(1).integers(0, 255, (2, 200, 300), dtype=np.uint8)
    assert Ailment.MATCHES in amber(diagnose(noise[0], noise[1]))
    with pytest.raises(ValueError, match="sure matches"):
        levelled(noise[0], noise[1])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_every_type_of_image_is_examined(pair: Pair, dtype: type) -> None:
    images = [image.astype(dtype) * (257 if dtype == np.uint16 else 1) for image in pair]
    assert len(find_correspondences(*images)) > 100
    assert exposed_alike(*images).dtype == dtype


def test_real_pairs(data_dir: Path) -> None:
    for name in ("motorcycle_q", "cones", "kitti2015_000046"):
        folder = data_dir / "stereo" / name
        left, right = read_image(folder / "left.png"), read_image(folder / "right.png")
        geometry = {Ailment.SWAPPED, Ailment.ROWS, Ailment.ROTATION}
        assert not amber(diagnose(left, right, num_disparities=80)) & geometry, name
        assert Ailment.SWAPPED in amber(diagnose(right, left)), name
        assert Ailment.ROWS in amber(diagnose(left, np.roll(right, 3, axis=0))), name
        assert Ailment.ROTATION in amber(diagnose(left, turned(right, 1.0))), name
