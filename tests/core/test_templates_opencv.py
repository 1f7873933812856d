"""OpenCV's search beside ours, and the outcome of each method on degraded images."""

from __future__ import annotations

import numpy as np
import pytest

from stereolag import samples
from stereolag.core.inputs import Image
from stereolag.io.images import read_image
from stereolag.templates import match_template
from stereolag.templates.trials import Degradation, Trial, degraded_part, is_masked, opencv_search, try_methods

RANDOM = np.random.default_rng(3)
SCENE = RANDOM.integers(0, 256, (90, 120, 3), dtype=np.uint8)
MASK = np.zeros((20, 24), dtype=np.uint8)
MASK[3:17, 5:20] = 1


@pytest.mark.parametrize("mask", [None, MASK])
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32", "float64"])
@pytest.mark.parametrize("grey", [True, False])
def test_both_give_the_same_scores(mask: Image | None, dtype: str, grey: bool) -> None:
    image = (SCENE[:, :, 0] if grey else SCENE).astype(dtype)
    template = image[30:50, 40:64]
    theirs, ours = opencv_search(image, template, mask=mask), match_template(image, template, mask=mask)
    assert (theirs.row, theirs.col) == (ours.matches[0].row, ours.matches[0].col) == (30, 40)
    assert theirs.undefined == 0
    assert ours.score_map is not None
    np.testing.assert_allclose(theirs.score_map, ours.score_map, atol=1e-4)


def test_alpha_is_the_mask() -> None:
    template = np.dstack([SCENE[30:50, 40:64], MASK * 255])
    by_alpha, by_mask = opencv_search(SCENE, template), opencv_search(SCENE, SCENE[30:50, 40:64], mask=MASK)
    np.testing.assert_array_equal(by_alpha.score_map, by_mask.score_map)
    assert is_masked(template, None)
    assert not is_masked(SCENE, None)


def test_under_a_mask_flat_windows_are_counted_and_passed_over() -> None:
    image = SCENE.copy()
    image[60:] = 90
    result = opencv_search(image, image[30:50, 40:64], mask=MASK)
    assert (result.row, result.col) == (30, 40)
    assert result.undefined == np.isnan(match_template(image, image[30:50, 40:64], mask=MASK).score_map).sum() > 0


@pytest.mark.parametrize(
    ("template", "fragment"), [(SCENE[:5, :5] * 0 + 7, "constant"), (np.zeros((91, 10)), "must fit into the image")]
)
def test_what_we_refuse_is_refused(template: Image, fragment: str) -> None:
    with pytest.raises(ValueError, match=fragment):
        opencv_search(SCENE, template)


def maze(**settings: float) -> dict[str, Trial]:
    example = samples.mazes()["maze"]
    image, template = read_image(example.picture), read_image(example.template)
    part = degraded_part(image, (example.row, example.col), template.shape[:2], Degradation(**settings))
    return {trial.method: trial for trial in try_methods(part.pixels, template, (part.row, part.col))}


@pytest.mark.parametrize(
    ("settings", "outcomes"),
    [
        ({}, "right right right"),
        ({"contrast": 0.3}, "right missed right"),
        ({"noise": 60}, "right missed right"),
        ({"cover": 0.5}, "right right right"),
        ({"cover": 0.8}, "missed missed missed"),
        ({"turn": 10}, "missed missed missed"),
        ({"resize": 0.9}, "missed missed missed"),
    ],
)
def test_what_becomes_of_rocketman(settings: dict[str, float], outcomes: str) -> None:
    trials = maze(**settings)
    assert [trials[method].outcome for method in ("fft", "sampled", "opencv")] == outcomes.split()
    fft, theirs = trials["fft"], trials["opencv"]
    assert (fft.row, fft.col) == (theirs.row, theirs.col)
    assert fft.score == pytest.approx(theirs.score, abs=1e-5)


def test_found_at_another_place_is_found_elsewhere() -> None:
    trials = try_methods(SCENE, SCENE[30:50, 40:64], (40, 40))
    assert {trial.outcome for trial in trials} == {"elsewhere"}
    assert {(trial.row, trial.col) for trial in trials} == {(30, 40)}


def test_where_nothing_varies_no_method_names_a_place() -> None:
    trials = try_methods(np.full((50, 50, 3), 7, dtype=np.uint8), SCENE[30:50, 40:64], (0, 0), mask=MASK)
    assert [(trial.outcome, trial.row) for trial in trials] == [("missed", None)] * 3


def test_a_method_that_cannot_search_says_why_and_the_others_go_on() -> None:
    trials = {one.method: one for one in try_methods(SCENE, SCENE[30:50, 40:64].astype(np.uint16), (30, 40))}
    assert [trials[name].outcome for name in ("fft", "sampled", "opencv")] == ["right", "refused", "right"]
    assert "needs one type" in trials["sampled"].refusal
