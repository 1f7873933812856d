"""Every code of the core has a sentence, and the sentences contain its numbers."""

from __future__ import annotations

import pytest

from stereolag.assess.doctor import Finding, FindingCode, Remedy
from stereolag.assess.doctor.findings import (
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
from stereolag.assess.doctor.row_evidence import RowEvidence
from stereolag.stereo.reasons import Reason
from stereolag.ui.depth.findings import REMEDIES_DONE, finding_in_words, problems_in_words, remedy_in_words
from stereolag.ui.sentences import (
    REASON_WORDS,
    REASONS_EXPLAINED,
    rectification_in_words,
)

HEALTHY = [
    (judge_matches(300), "300 features match between the images."),
    (judge_sides(3.2, 40.0), "Left is left: disparities run from 3 to 40 px."),
    (judge_raw_sides(3.2, 40.0, 0.9, 0.0), "Left is left: disparities run from 3 to 40 px."),
    (judge_raw_sides(-9.0, 8.0, 0.4, 0.5), "It is unclear which image is the left one"),
    (judge_identical(0.1, None, 1.0), "The images differ."),
    (judge_identical(0.1, 12.3, 1.0), "The images differ: features move by up to 12 px."),
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
    (judge_identical(0.0, None, 1.0), "Both images show the same view", ""),
    (judge_identical(0.01, 0.1, 1.0), "Both images show the same view", ""),
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
    assert {*REASON_WORDS} == {*Reason}
    assert {*REASONS_EXPLAINED} == {*Reason} - {Reason.MEASURED}


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
        "The pair is rectified already, as you said: rows differ by 0.19 px, and by an unknown amount if rectified "
        "again (medians of 157 and 3 matched features)."
    )
