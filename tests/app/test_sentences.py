"""Every code of the core has a sentence, and the sentences hold its numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pairs import shifted_pair

from stereolag.doctor import Finding, FindingCode, Remedy
from stereolag.doctor.findings import (
    judge_bent_rows,
    judge_exposure,
    judge_identical,
    judge_matches,
    judge_raw_sides,
    judge_rotation,
    judge_rows,
    judge_searched,
    judge_sides,
    judge_texture,
)
from stereolag.doctor.row_evidence import RowEvidence
from stereolag.explaining.example_pixels import ExampleKind
from stereolag.explaining.match import MatchKind, explain_match
from stereolag.stereo.reasons import Reason
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.ui.depth.findings import REMEDIES_DONE, finding_in_words, problems_in_words, remedy_in_words
from stereolag.ui.sentences import (
    EXAMPLE_LABELS,
    REASON_WORDS,
    REASONS_EXPLAINED,
    match_against_truth,
    match_in_words,
    rectification_in_words,
)

HEALTHY = [
    (judge_matches(300), "300 features match between the images."),
    (judge_sides(3.2, 40.0), "Left is left: disparities run from 3 to 40 px."),
    (judge_raw_sides(3.2, 40.0, 0.9, 0.0), "Left is left: disparities run from 3 to 40 px."),
    (judge_raw_sides(-9.0, 8.0, 0.4, 0.5), "Which image is the left one cannot be told"),
    (judge_identical(0.1, None, 1.0), "The pictures differ."),
    (judge_identical(0.1, 12.3, 1.0), "The pictures differ: features move by up to 12 px."),
    (judge_bent_rows(0.4, 0.2, (-0.5, 0.6), 1.0, None), "Rows do not bend (spread 0.4 px, of which 0.2 px are noise)."),
    (judge_rows(-0.31, 0.2), "Rows match to 0.3 px (spread 0.2 px)."),
    (judge_rotation(0.02, 1.001), "The right image is rotated by +0.02° and scaled by +0.1 %: close enough."),
    (judge_exposure(1.0, 2.0, 200.0), "1.00 times the left one’s contrast, offset by +2 grey levels: close enough."),
    (judge_texture(0.06), "6 % of the image has hardly any texture."),
    (
        judge_searched((2.0, 50.0), (0, 64), (0, 64)),
        "needs about 2 to 50 px, and 0 to 63 px are searched: a good range.",
    ),
]
ILL = [
    (judge_matches(12), "Only 12 features match between the images", ""),
    (judge_matches(0), "No features match between the images", ""),
    (judge_sides(-40.0, -3.0), "run from -40 to -3 px, and they should be positive", "Swap left and right"),
    (judge_raw_sides(-90.0, -3.0, 0.0, 0.9), "Left and right look swapped: disparities run from -90", "Swap left and"),
    (judge_identical(0.0, None, 1.0), "Both pictures show one and the same view", ""),
    (judge_identical(0.01, 0.1, 1.0), "Both pictures show one and the same view", ""),
    (
        judge_bent_rows(3.5, 0.3, (-5.5, 4.1), 1.0, None),
        "still off by -5.5 to +4.1 px (spread 3.5 px, of which 0.3 px are noise)",
        "",
    ),
    (
        judge_bent_rows(3.5, 0.3, (-5.5, 4.1), 1.0, (0.4, -0.2)),
        "with one coefficient for the lenses, 0.4 px remain on unused features.",
        "Rectify both images",
    ),
    (
        judge_bent_rows(3.5, 0.3, (-5.5, 4.1), 1.0, (0.4, 0.0)),
        "Rectified from the images alone, 0.4 px remain",
        "Rectify both images",
    ),
    (judge_rows(3.04, 0.2), "sits 3.0 px lower than the left (spread 0.2 px)", "Align the rows"),
    (judge_rows(-3.04, 0.2), "sits 3.0 px higher than the left", "Align the rows"),
    (judge_rotation(-1.0, 0.98), "rotated by -1.00° and scaled by -2.0 %: the pair is not rectified", "Rectify from"),
    (
        judge_exposure(0.6, -5.0, 200.0),
        "0.60 times the left one’s contrast, offset by -5 grey levels: ZNCC",
        "Match the",
    ),
    (judge_texture(0.4), "40 % of the image has hardly any texture: windows cannot be matched there", ""),
    (
        judge_searched((2.0, 50.0), (0, 16), (0, 64)),
        "0 to 15 px are searched: too small",
        "Search 64 disparities from 0",
    ),
    (
        judge_searched((2.0, 2.4), (-3, 256), (-3, 16)),
        "needs about 2 px, and -3 to 252 px are",
        "Search 16 disparities from -3",
    ),
]


@pytest.mark.parametrize(("finding", "said"), HEALTHY, ids=lambda one: str(getattr(one, "code", "")))
def test_a_healthy_finding_gives_its_numbers(finding: Finding, said: str) -> None:
    assert finding.healthy
    assert said in finding_in_words(finding)
    assert remedy_in_words(finding) == ""


@pytest.mark.parametrize(("finding", "said", "remedy"), ILL, ids=lambda one: str(getattr(one, "code", "")))
def test_an_unhealthy_finding_gives_its_numbers_and_its_remedy(finding: Finding, said: str, remedy: str) -> None:
    assert not finding.healthy
    assert said in finding_in_words(finding)
    assert remedy_in_words(finding).startswith(remedy)
    assert bool(remedy) == bool(finding.remedy)


def test_every_code_has_words() -> None:
    assert {finding.code for finding, _ in HEALTHY} == {finding.code for finding, *_ in ILL} == {*FindingCode}
    assert {finding.remedy for finding, *_ in ILL} - {None} == {*Remedy}
    assert {*REMEDIES_DONE} == {*Remedy} - {Remedy.SET_RANGE}
    assert {*EXAMPLE_LABELS} == {*ExampleKind}
    assert {*REASON_WORDS} == {*Reason}
    assert {*REASONS_EXPLAINED} == {*Reason} - {Reason.MEASURED}


SAID = {
    MatchKind.CLEAR: "One clear peak: 0.900; the next best place scores 0.500.",
    MatchKind.REPEATS: "Two places fit almost equally well (0.900 and 0.890), with worse ones between them",
    MatchKind.SMOOTH: "Two places fit almost equally well (0.900 and 0.890), and so do those between them",
    MatchKind.BARE: "A bare wall: the window has 5% of the image’s contrast, and its best score is 0.30",
    MatchKind.UNLIKE: "Nothing looks like this: the best score is 0.30",
    MatchKind.AT_EDGE: "The best score lies on the edge",
    MatchKind.NOTHING: "Nothing to correlate",
}


@pytest.mark.parametrize("kind", MatchKind)
def test_every_kind_of_match_has_a_sentence(kind: MatchKind) -> None:
    matcher = CorrelationMatcher(window_size=11, search=SearchArea.rectified(24))
    seen = explain_match(matcher, *shifted_pair(60, 100, 0, -6), 30, 60)
    surface = np.full((1, 24), 0.5 if kind is MatchKind.REPEATS else 0.9)
    peak, runner_up = (0, -6), (0, -20)
    seen = replace(
        seen,
        surface=surface,
        peak=None if kind is MatchKind.NOTHING else peak,
        runner_up=runner_up,
        peak_score=0.3 if kind in (MatchKind.BARE, MatchKind.UNLIKE) else 0.9,
        runner_up_score=0.89 if kind in (MatchKind.REPEATS, MatchKind.SMOOTH) else 0.5,
        contrast=0.05 if kind is MatchKind.BARE else 0.8,
        at_edge=kind is MatchKind.AT_EDGE,
    )
    assert seen.kind is kind
    assert match_in_words(seen).startswith(SAID[kind])


def test_a_match_without_a_runner_up_is_clear() -> None:
    matcher = CorrelationMatcher(window_size=11, search=SearchArea.rectified(3, 5))
    seen = explain_match(matcher, *shifted_pair(60, 100, 0, -6), 30, 60)
    assert np.isnan(seen.runner_up_score)
    assert match_in_words(seen) == f"One clear peak: {seen.peak_score:.3f}."


def test_a_match_is_compared_with_the_ground_truth() -> None:
    assert (
        match_against_truth(12.5, 12.0) == "The match gives 12.50 px and the ground truth is 12.00 px: it is **right**."
    )
    assert match_against_truth(12.5, 20.0).endswith("it is **wrong** by 7.5 px.")


@pytest.mark.parametrize(
    ("count", "said"), [(1, "one problem found on this pair"), (3, "3 problems found on this pair")]
)
def test_problems_are_counted(count: int, said: str) -> None:
    assert said in problems_in_words(count)


def test_the_rows_before_and_after_rectification_are_said():
    raw, straight = RowEvidence(11.9, 0.19, 190, 157), RowEvidence(0.19, float("nan"), 157, 3)
    assert rectification_in_words(raw, True, False, True) == (
        "The pair was undistorted and rectified with its calibration: rows differ by 0.19 px, before by 12 px (medians "
        "of 157 and 190 matched features). Its ground truth belongs to the image before that and is left out."
    )
    assert rectification_in_words(straight, False, True, False) == (
        "The pair is rectified already, as you said: rows differ by 0.19 px, rectified once more by an unknown amount "
        "(medians of 157 and 3 matched features)."
    )
