"""Sentences about a match: one text for every kind, outcome and fate, none of which contradicts itself."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from pairs import shifted_pair

from stereolag.assess.explaining.example_pixels import ExampleKind
from stereolag.assess.explaining.match import MatchExplanation, MatchKind, explain_match
from stereolag.stereo.reasons import Reason
from stereolag.stereo.windows.matcher import CorrelationMatcher
from stereolag.stereo.windows.search import SearchArea
from stereolag.ui.match_sentences import (
    EXAMPLE_LABELS,
    HIDDEN_FROM_RIGHT,
    HOVER_WORDS,
    NO_EXAMPLE,
    match_against_truth,
    match_in_words,
    verdict,
)

SAID = {
    MatchKind.CLEAR: "One clear peak: 0.900; the next one scores 0.500.",
    MatchKind.REPEATS: "Two places fit almost equally well (0.900 and 0.890), with worse ones between them",
    MatchKind.SMOOTH: "Neighbouring places fit almost equally well (0.900, and 0.890 farther than 1 px from it)",
    MatchKind.BARE: "A bare wall: the window has 5\N{NO-BREAK SPACE}% of the image’s contrast, and its best score is",
    MatchKind.UNLIKE: "Nothing looks like this: the best score is 0.30",
    MatchKind.AT_EDGE: "The best score is on the edge",
    MatchKind.NOTHING: "Nothing to correlate",
}

WITHOUT_DISPARITY = (MatchKind.AT_EDGE, MatchKind.NOTHING)


@cache
def match_of(kind: MatchKind) -> MatchExplanation:
    """Return a match of the given kind, with a disparity of about 6 px and searched from 0 to 23 px."""
    matcher = CorrelationMatcher(window_size=11, search=SearchArea.rectified(24))
    seen = replace(
        explain_match(matcher, *shifted_pair(60, 100, 0, -6), 30, 60),
        offset=(0.0, 0.0),
        runner_up=(0, -20),
        peak_score=0.3 if kind in (MatchKind.BARE, MatchKind.UNLIKE) else 0.9,
        runner_up_score=0.89 if kind is MatchKind.REPEATS else 0.5,
        valley=0.0,
        flank_score=0.89 if kind is MatchKind.SMOOTH else 0.6,
        as_good=0.027,
        contrast=0.05 if kind is MatchKind.BARE else 0.8,
        at_edge=kind is MatchKind.AT_EDGE,
    )
    seen = replace(seen, peak=None) if kind is MatchKind.NOTHING else seen
    assert seen.kind is kind
    return seen


def test_every_kind_has_words() -> None:
    assert {*SAID} == {*MatchKind} == {*HOVER_WORDS["kinds"]}
    assert {*EXAMPLE_LABELS} == {*NO_EXAMPLE} == {*ExampleKind}


@pytest.mark.parametrize("kind", MatchKind)
def test_every_kind_of_match_has_a_sentence(kind: MatchKind) -> None:
    assert match_in_words(match_of(kind)).startswith(SAID[kind])


def test_a_match_without_a_runner_up_is_clear() -> None:
    matcher = CorrelationMatcher(window_size=11, search=SearchArea.rectified(3, 5))
    seen = explain_match(matcher, *shifted_pair(60, 100, 0, -6), 30, 60)
    assert np.isnan(seen.runner_up_score)
    assert match_in_words(seen) == f"One clear peak: {seen.peak_score:.3f}."


TRUTHS = {"right": 6.2, "wrong": 15.0, "unknown": math.nan}


@pytest.mark.parametrize("outcome", TRUTHS)
@pytest.mark.parametrize("kind", MatchKind)
def test_no_verdict_contradicts_itself(kind: MatchKind, outcome: str) -> None:
    for reason, visible in product([None, *Reason], [True, False]):
        assert_no_contradiction(kind, outcome, reason, visible)


def assert_no_contradiction(kind: MatchKind, outcome: str, reason: Reason | None, visible: bool) -> None:
    seen, truth = match_of(kind), TRUTHS[outcome]
    kept = {None: math.nan, Reason.MEASURED: seen.disparity, Reason.FILLED: 11.0}.get(reason, math.nan)
    said = verdict(seen, truth, visible=visible, reason=reason, disparity=kept)
    bold = {word for word in ("right", "wrong") if f"**{word}**" in said}
    assert bold == ({outcome} & {"right", "wrong"} if kind not in WITHOUT_DISPARITY else set())
    assert not any(word in said for word in ("chance", "luck", "nan", "  ", "decides"))
    assert ("The scores cannot tell" in said) <= (outcome == "unknown")
    assert ("as it should be" in said) <= (outcome == "wrong" and kind not in WITHOUT_DISPARITY)
    assert ("The map keeps it" in said) <= (reason == Reason.MEASURED)
    assert ("blank" in said) == (reason not in (None, Reason.MEASURED, Reason.FILLED))
    assert (HIDDEN_FROM_RIGHT in said) != visible
    assert said.rstrip("*").endswith(".")


@pytest.mark.parametrize(
    ("kind", "truth", "said"),
    [
        (MatchKind.CLEAR, 6.2, "It is **right**: 6.00 px, and the ground truth is 6.20 px."),
        (
            MatchKind.REPEATS,
            15.0,
            "The better of the two is **wrong** by 9.0 px: 6.00 px, and the ground truth is 15.00",
        ),
        (MatchKind.REPEATS, 20.3, "The true place is the runner-up."),
        (MatchKind.AT_EDGE, 40.0, "The ground truth is 40.00 px, outside the search, which runs from 0 to 23 px."),
        (MatchKind.NOTHING, 12.0, "The ground truth is 12.00 px."),
        (MatchKind.REPEATS, math.nan, "The scores cannot tell which of the two is the true place."),
    ],
)
def test_a_match_is_compared_with_the_ground_truth(kind: MatchKind, truth: float, said: str) -> None:
    assert said in match_against_truth(match_of(kind), truth)


def test_a_map_that_filtered_says_what_it_holds() -> None:
    said = verdict(match_of(MatchKind.CLEAR), 6.0, reason=Reason.MEASURED, disparity=7.5)
    assert said.endswith("After filtering, the map has 7.50 px.")


@pytest.mark.parametrize(("valley", "said"), [(-0.3, "the pattern repeats, like a fence"), (0.8, "they look alike")])
def test_only_a_deep_valley_makes_a_repetition(valley: float, said: str) -> None:
    assert said in match_in_words(replace(match_of(MatchKind.REPEATS), valley=valley))
