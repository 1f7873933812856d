"""The input doctor finds the fault of a pair, finds nothing wrong with a healthy one, and its remedies work."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from ailing_pairs import ILLS, REMEDIES, turned
from diagnosed import diagnosed

from stereolag.assess.diagnosis import Diagnosis, FindingCode, judge_range
from stereolag.assess.orientation import find_correspondences
from stereolag.assess.remedies import Remedy, apply_remedy, exposed_alike, levelled
from stereolag.io.disparities import read_disparity
from stereolag.io.images import read_image
from stereolag.samples import stereo_pairs

Pair = tuple[np.ndarray, np.ndarray]


def amber(diagnosis: Diagnosis) -> set[FindingCode]:
    return {finding.code for finding in diagnosis.findings if not finding.healthy}


def number(diagnosis: Diagnosis, code: FindingCode, name: str) -> float:
    finding = diagnosis.finding(code)
    assert finding is not None
    return finding.numbers[name]


@pytest.fixture(scope="module", params=["road", "cube"])
def pair(request: pytest.FixtureRequest) -> Pair:
    example = stereo_pairs()[request.param]
    return read_image(example.left), read_image(example.right)


@pytest.fixture(scope="module")
def cube() -> Pair:
    example = stereo_pairs()["cube"]
    return read_image(example.left), read_image(example.right)


def test_a_rectified_pair_is_healthy_in_its_geometry(pair: Pair) -> None:
    diagnosis = diagnosed(*pair, num_disparities=80)
    assert not amber(diagnosis) & {
        FindingCode.SWAPPED,
        FindingCode.ROWS,
        FindingCode.ROTATION,
        FindingCode.EXPOSURE,
        FindingCode.MATCHES,
    }
    assert abs(number(diagnosis, FindingCode.ROWS, "offset_px")) < 0.3
    assert abs(number(diagnosis, FindingCode.ROTATION, "rotation_deg")) < 0.1
    assert number(diagnosis, FindingCode.ROTATION, "scale") == pytest.approx(1, abs=0.003)


def test_swapped_sides_are_caught(pair: Pair) -> None:
    assert FindingCode.SWAPPED in amber(diagnosed(pair[1], pair[0]))


def test_a_row_offset_is_measured_and_fixed(pair: Pair) -> None:
    shifted = np.roll(pair[1], -5, axis=0)
    diagnosis = diagnosed(pair[0], shifted)
    assert FindingCode.ROWS in amber(diagnosis)
    assert number(diagnosis, FindingCode.ROWS, "offset_px") == pytest.approx(-5, abs=0.3)
    assert abs(number(diagnosed(pair[0], levelled(pair[0], shifted)), FindingCode.ROWS, "offset_px")) < 0.3


@pytest.mark.parametrize(("degrees", "scale"), [(-2.0, 1.0), (0.0, 1.02)])
def test_rotation_and_scale_are_measured_and_fixed(pair: Pair, degrees: float, scale: float) -> None:
    view = turned(pair[1], degrees, scale)
    diagnosis = diagnosed(pair[0], view)
    assert FindingCode.ROTATION in amber(diagnosis)
    # getRotationMatrix2D takes anticlockwise as positive, but rows grow downwards.
    assert number(diagnosis, FindingCode.ROTATION, "rotation_deg") == pytest.approx(-degrees, abs=0.15)
    assert number(diagnosis, FindingCode.ROTATION, "scale") == pytest.approx(scale, abs=0.005)
    assert not amber(diagnosed(pair[0], levelled(pair[0], view))) & {FindingCode.ROTATION, FindingCode.ROWS}


def test_a_darkened_view_is_measured_and_fixed(pair: Pair) -> None:
    dark = np.rint(pair[1] * 0.6).astype(np.uint8)
    diagnosis = diagnosed(pair[0], dark)
    assert FindingCode.EXPOSURE in amber(diagnosis)
    assert number(diagnosis, FindingCode.EXPOSURE, "gain") == pytest.approx(0.6, abs=0.08)
    assert FindingCode.EXPOSURE not in amber(diagnosed(pair[0], exposed_alike(pair[0], dark)))


def test_the_range_is_judged_against_the_disparities_in_the_pair(pair: Pair) -> None:
    narrow = diagnosed(*pair, num_disparities=16).finding(FindingCode.RANGE)
    assert narrow is not None
    assert narrow.remedy is Remedy.SET_RANGE
    assert narrow.numbers["missing_px"] > 0
    wide = diagnosed(*pair, num_disparities=256)
    finding = wide.finding(FindingCode.RANGE)
    assert finding is not None
    assert finding.remedy is Remedy.SET_RANGE
    assert finding.numbers["missing_px"] == 0
    assert wide.suggested_range is not None
    first, count = wide.suggested_range
    suggested = finding.numbers["suggested_min_disparity"], finding.numbers["suggested_num_disparities"]
    assert (first, count) == suggested
    assert count % 16 == 0
    assert FindingCode.RANGE not in amber(diagnosed(*pair, min_disparity=first, num_disparities=count))


@pytest.mark.parametrize("name", stereo_pairs())
def test_the_range_holds_what_there_is_and_little_more_on_a_fence_too(name: str) -> None:
    example = stereo_pairs()[name]
    found = diagnosed(read_image(example.left), read_image(example.right)).suggested_range
    assert found is not None
    first, count = found
    truth = read_disparity(example.disparity)
    low, high = np.nanpercentile(truth, (0.1, 99.9))
    assert first <= low < high <= first + count - 1
    assert first >= -16
    assert first + count <= high + 0.3 * (high - low) + 32


def test_a_range_is_judged_without_looking_again(cube: Pair) -> None:
    diagnosis = diagnosed(*cube)
    for count in (16, 64, 256):
        assert judge_range(diagnosis, 0, count) == diagnosed(*cube, num_disparities=count).finding(FindingCode.RANGE)
    swapped = diagnosed(cube[1], cube[0])
    assert judge_range(swapped, 0, 64) is None
    assert swapped.finding(FindingCode.RANGE) is None
    assert swapped.suggested_range is None


@pytest.mark.parametrize("code", ILLS)
def test_every_remedy_fixes_its_finding_and_keeps_size_and_type(cube: Pair, code: FindingCode) -> None:
    ill = ILLS[code](*cube)
    found = diagnosed(*ill).finding(code)
    assert found is not None
    assert not found.healthy
    assert found.remedy is REMEDIES[code]
    left, right = apply_remedy(*ill, found.remedy)
    again = diagnosed(left, right).finding(code)
    assert again is not None
    assert again.healthy
    assert again.remedy is None
    assert right.shape == cube[1].shape
    assert right.dtype == cube[1].dtype
    assert left is cube[0]


def test_findings_are_frozen_and_survive_another_process(cube: Pair) -> None:
    diagnosis = diagnosed(*cube)
    with pytest.raises(TypeError):
        diagnosis.findings[0].numbers["count"] = 0  # type: ignore[index]
    assert pickle.loads(pickle.dumps(diagnosis)) == diagnosis
    assert len({*diagnosis.findings}) == len(diagnosis.findings)


def test_aligned_rows_keep_the_disparities(cube: Pair) -> None:
    aligned = apply_remedy(cube[0], np.roll(cube[1], 3, axis=0), Remedy.ALIGN_ROWS)[1]
    assert np.mean(np.abs(aligned[8:-8].astype(float) - cube[1][8:-8])) < 2.5


def test_a_remedy_that_changes_no_image_is_refused(cube: Pair) -> None:
    with pytest.raises(ValueError, match="remedy is 'set_range', which changes the search range of a matcher"):
        apply_remedy(*cube, Remedy.SET_RANGE)


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (1, 3_000), (30, 200), (64, 1)])
def test_images_too_small_for_features_are_examined_all_the_same(shape: tuple[int, int]) -> None:
    left, right = np.random.default_rng(3).integers(0, 256, (2, *shape), dtype=np.uint8)
    assert len(find_correspondences(left, right)) == 0
    assert FindingCode.MATCHES in amber(diagnosed(left, right))


def test_low_texture_and_unrelated_images_are_found() -> None:
    flat = np.full((200, 300), 90, np.uint8)
    flat[80:120, 100:180] = np.random.default_rng(0).integers(0, 255, (40, 80))
    assert FindingCode.TEXTURE in amber(diagnosed(flat, flat))
    noise = np.random.default_rng(1).integers(0, 255, (2, 200, 300), dtype=np.uint8)
    assert FindingCode.MATCHES in amber(diagnosed(noise[0], noise[1]))
    with pytest.raises(ValueError, match="features were matched"):
        levelled(noise[0], noise[1])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_every_type_of_image_is_examined(cube: Pair, dtype: type) -> None:
    images = [image.astype(dtype) * (257 if dtype == np.uint16 else 1) for image in cube]
    assert len(find_correspondences(*images)) > 100
    assert exposed_alike(*images).dtype == dtype


def test_real_pairs(data_dir: Path) -> None:
    for name in ("motorcycle_q", "cones", "kitti2015_000046"):
        folder = data_dir / "stereo" / name
        left, right = read_image(folder / "left.png"), read_image(folder / "right.png")
        geometry = {FindingCode.SWAPPED, FindingCode.ROWS, FindingCode.ROTATION}
        assert not amber(diagnosed(left, right, num_disparities=80)) & geometry, name
        assert FindingCode.SWAPPED in amber(diagnosed(right, left)), name
        assert FindingCode.ROWS in amber(diagnosed(left, np.roll(right, 3, axis=0))), name
        assert FindingCode.ROTATION in amber(diagnosed(left, turned(right, 1.0))), name
