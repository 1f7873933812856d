"""Sentences about results: verdicts, findings, matches and alternative texts, as a reader sees them."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import get_args

import numpy as np
from pairs import shifted_pair

import stereolag as sl
from benchmarks.verdict import coloured, common, drifting, tones, unrelated
from stereolag.assess import findings, suggestion
from stereolag.assess.diagnosis import Diagnosis, judge_range
from stereolag.assess.explaining import ExampleKind, MatchExplanation, MatchKind, explain_match
from stereolag.assess.findings import Finding, FindingCode, Remedy
from stereolag.assess.judging import Criterion, Unjudged
from stereolag.assess.layout import Epipole, Layout
from stereolag.assess.orientation import RowEvidence
from stereolag.assess.sentences import finding_in_words
from stereolag.assess.suggestion import Outcome, Suggestion
from stereolag.core.arrays import Box
from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.figures import verdicts
from stereolag.figures.match import window_grid
from stereolag.io.clocks import Recording
from stereolag.io.results import left_out_in_words
from stereolag.pair import REMEDIES_DONE, RectificationDecision
from stereolag.signals import phasors
from stereolag.stereo.evaluation import CoverageCurve
from stereolag.stereo.finishing.stages import MedianFilter
from stereolag.templates.by_hand import reduced_search
from stereolag.templates.identity import Kind
from stereolag.templates.trials import Degradation, OpenCVSearch, Trial, opencv_search, try_methods
from stereolag.templates.verdict import Reason as SearchReason
from stereolag.ui import sentences
from stereolag.ui.depth import sentences as depth
from stereolag.ui.lag import sentences as lag
from stereolag.ui.search import sentences as search
from tests.app import uploads
from tests.snapshots import Snapshot


def test_lags(snapshot: Snapshot) -> None:
    random = np.random.default_rng(5)
    clip = random.normal(size=3000)
    headings = np.cumsum(20 * np.random.default_rng(6).normal(size=3000)) % 360
    whole = coloured(6000, 0.8, np.random.default_rng(4))
    late = np.concatenate((np.zeros(25), clip))
    first, second = drifting(150_000, 400, 50.0, 0.0, 1)
    loud = 0.01 * random.normal(size=(2, 8_000))
    loud[0, 3_000:3_060] += clip[:60]
    loud[1, 5_000:5_060] += clip[60:120]
    results = {
        "sure": sl.signal_lag(*common(20_000, 441, 0, colour=0.0)),
        "heard first": sl.signal_lag(late, clip),
        "at the same time": sl.signal_lag(clip, clip),
        "tone": sl.signal_lag(*tones(6000, 0.01, 0.0, 0)),
        "tone of a broken period": sl.signal_lag(*tones(6000, 0.1234, 0.0, 0)),
        "one rival": sl.signal_lag(clip, np.concatenate((clip, random.normal(size=5000), clip))),
        "unrelated": sl.signal_lag(*unrelated("noise and noise", 3000, 0)),
        "beyond the largest lag": sl.signal_lag(clip, np.pad(clip, (900, 0)), max_lag=500),
        "unrelated, loud moments": sl.signal_lag(*loud),
        "three lags": sl.signal_lag(clip, np.concatenate((clip, loud[0], clip, clip[::-1], clip))),
        "few votes": sl.signal_lag(*common(20_000, 300, 0), method="sampled", seed=0),
        "unrelated, by votes": sl.signal_lag(*unrelated("noise and noise", 10_000, 0), method="sampled", seed=0),
        "by votes": sl.signal_lag(clip, late, method="sampled", seed=0),
        "reversed microphone": sl.signal_lag(whole[1000:5000], -whole[:4000]),
        "drift": sl.signal_lag(first, second, max_lag=2000),
        "drift the other way": sl.signal_lag(second[403:], first, max_lag=2000),
        "step": sl.signal_lag(first, np.delete(second, slice(60_000, 61_000))),
        "headings": sl.signal_lag(headings[40:], headings),
        "echo": sl.signal_lag(clip, np.pad(clip, (25, 500)) + 0.5 * np.pad(clip, (525, 0))),
        "a short path": sl.signal_lag(late, clip, speed=1),
    }
    said = {}
    for name, one in results.items():
        said[name] = [verdicts.verdict_in_words(one), *verdicts.verdict_explained(one)]
        said[name].append(f"curve: {verdicts.curve_in_words(one)}")
        if one.lags is not None:
            said[name].append(f"below it: {lag.ribbon_in_words(one, 'weighted')}")
        if one.over_time is not None:
            said[name].append(f"over time: {lag.blocks_in_words(one.over_time, 44_100.0)}")
            if one.over_time.changes:
                said[name].append(f"below it: {lag.drift_in_words(one.over_time)}")
    said["assumed"] = [
        verdicts.verdict_in_words(results[name], given)
        for name, given in (("sure", {"speed"}), ("sure", {"speed", "sampling_rate"}), ("step", {"sampling_rate"}))
    ]
    said["recordings"] = [lag.waveforms_in_words(clip, late, 1000.0), lag.run_times_in_words(np.array([0.1, 0.2, 0.4]))]
    rows = np.zeros((1, 16))
    own = (Recording(rows, None, mended_lines=2), Recording(rows, 8_000.0, resampled_from=16_000.0))
    heard = [results[name] for name in ("sure", "at the same time", "unrelated")]
    said["heard"] = [lag.heard_in_words(one) for one in (sl.signal_lag(clip, late, sampling_rate=100), *heard)]
    far, near = phasors.tone(), phasors.common_stretch("own", clip, clip, 0)
    assert near is not None
    said["arrows"] = [lag.own_in_words(one)["said"]["plain"] for one in (near, far)]
    snapshot(said | {"own recordings": [lag.own_facts(own, (1, 2), (1, 2))]})


def answer(*scores: float, reason: SearchReason, clear: int = 0) -> sl.TemplateSearch:
    kind: Kind = reason if reason in get_args(Kind) else "same"  # type: ignore[assignment]
    agrees = ((kind not in ("partly_covered", "differs", "not_there"), True),)
    contrast = {"lower_contrast": 0.35, "higher_contrast": 1.6}.get(reason, 1.0)
    places = [
        sl.TemplateMatch(0, 50 * index, 10, 10, score, kind=kind, contrast=contrast, blocks=agrees)
        for index, score in enumerate(scores)
    ]
    best = places[0] if places else None
    return sl.TemplateSearch(places[: max(clear, 1)], None, 9, 0.1, best, places[max(clear, 1) :], clear, reason)


def test_searches(snapshot: Snapshot) -> None:
    covered = answer(0.9, reason="partly_covered", clear=1)
    turned = sl.TemplateMatch(3, 4, 12, 12, 0.9, 1.2, -15.04)
    results = {
        "one": answer(0.9, 0.3, reason="clear", clear=1),
        "two": answer(0.9, 0.9, 0.3, reason="clear", clear=2),
        "turned": sl.TemplateSearch([turned], None, 9, 0.1, turned, [], 1, "clear"),
        "look-alikes": answer(0.62, 0.6, 0.6, 0.58, 0.1, reason="look_alikes"),
        "equal": answer(1.0, 1.0, 1.0, 0.5, reason="look_alikes"),
        "many": answer(*[0.5] * 12, 0.45, reason="look_alikes"),
        "look-alike near": answer(0.9, 0.85, reason="clear", clear=1),
        "paler": answer(1.0, 0.3, reason="lower_contrast", clear=1),
        "darker": answer(1.0, 1.0, 0.3, reason="higher_contrast", clear=2),
        "covered": answer(0.8, 0.3, reason="partly_covered", clear=1),
        "sibling": answer(0.9, 0.3, reason="differs"),
        "something else": answer(0.9, reason="not_there"),
        "other colours": answer(0.8, 0.3, reason="other_colours"),
        "mirrored": answer(0.8, 0.3, reason="mirrored"),
        "low score": answer(0.3, reason="low_score"),
        "nothing": answer(reason="low_score"),
        "cut off": replace(covered, score_map=np.zeros((9, 0), np.float32)),
        "found by parts": replace(covered, score_map=np.zeros((9, 9), np.float32)),
        "missing values": replace(answer(0.9, reason="clear", clear=1), left_out=0.124),
        "few missing values": replace(answer(0.9, reason="clear", clear=1), left_out=0.001),
    }
    said = {}
    for name, one in results.items():
        said[name] = [verdicts.headline(one), verdicts.framed_in_words(one)]
        if one.found:
            more = search.found_in_words(one), search.nearest_in_words(one), left_out_in_words(one)
            said[name] += [sentence for sentence in more if sentence]
        else:
            said[name].append(search.why_not_found(one, TemplateQuery()))
    for how, query in {"by exact pixels": {"method": "sampled"}, "turned": {"max_rotation": 30}}.items():
        asked = TemplateQuery(**query)
        said |= {f"{name} {how}": [search.why_not_found(results[name], asked)] for name in ("low score", "nothing")}
        said[f"no score map {how}"] = [search.why_no_score_map(asked)]
    scene = uploads.texture(60, 90)
    small = reduced_search(scene, scene[20:40, 30:50], None)
    said["by hand"] = [search.scale_of(replace(small, factor=one, part=part)) for one, part in ((1, False), (4, True))]
    counts = [verdicts.doubtful(results[name]) for name in ("one", "look-alikes", "low score")]
    assert [len(one) for one in counts] == [0, 4, 1]
    snapshot(said)


def test_damage(snapshot: Snapshot) -> None:
    scene = np.random.default_rng(5).integers(0, 256, (90, 120, 3), dtype=np.uint8)
    found = tuple(replace(one, elapsed_s=0.1) for one in try_methods(scene, scene[30:50, 40:64], (30, 40)))
    away = try_methods(scene, scene[30:50, 40:64], (0, 0))
    fft, sampled, opencv = found
    missed = replace(fft, outcome="missed", score=0.3)
    lost = replace(sampled, outcome="missed", row=None, col=None, score=float("nan"))
    nothing = Trial("fft", "missed", None, None, float("nan"), 0.1)
    refused = replace(lost, outcome="refused", refusal="It cannot.")
    cases: dict[str, tuple[Sequence[Trial], Degradation]] = {
        "not damaged": (found, Degradation()),
        "enough exact pixels": (found, Degradation(cover=0.1)),
        "another place": (away, Degradation(cover=1)),
        "no exact pixels": ((fft, lost, opencv), Degradation(noise=5)),
        "turned": ((missed, lost, opencv), Degradation(turn=20)),
        "noise": ((missed, lost, opencv), Degradation(noise=90)),
        "all covered": ((nothing, lost, opencv), Degradation(cover=1)),
        "refused": ((fft, refused, opencv), Degradation(noise=5)),
    }
    said = {name: search.lesson((*trials,), damage, 0.5) for name, (trials, damage) in cases.items()}
    numbers = {"found": found[0], "missed": missed, "no place": lost, "cannot": refused}
    snapshot(said | {"numbers": [f"{name}: {search.numbers_of(trial)}" for name, trial in numbers.items()]})


def test_opencv_beside(snapshot: Snapshot) -> None:
    scene = np.random.default_rng(5).integers(0, 256, (90, 120, 3), dtype=np.uint8)
    mask = np.zeros((20, 24), dtype=np.uint8)
    mask[3:17, 5:20] = 1
    half_flat = scene.copy()
    half_flat[60:] = 90
    other = np.random.default_rng(6).integers(0, 256, (20, 20, 3), dtype=np.uint8)
    said: dict[str, list[str]] = {}
    for name, image, template, given in (
        ("same place", scene, scene[30:50, 40:64], mask),
        ("flat windows", half_flat, half_flat[30:50, 40:64], mask),
        ("not found", scene, other, None),
        ("nothing varies", np.full_like(scene, 7), scene[30:50, 40:64], mask),
    ):
        ours = replace(sl.match_template(image, template, mask=given), elapsed_s=0.1)
        theirs = replace(opencv_search(image, template, mask=given), elapsed_s=0.2)
        said[name] = [
            *search.table(ours, theirs, "fft", given is not None).splitlines()[2:],
            *search.differences(ours, theirs, "fft"),
        ]
        if not ours.found:
            said[f"{name}, by exact pixels"] = search.differences(replace(ours, score_map=None), theirs, "sampled")
    ours = sl.match_template(scene, scene[30:50, 40:64])
    assert ours.score_map is not None
    for name, here, score in (("flat there", np.nan, 1.0), ("several copies", 1.0, 1.0), ("imprecise", 0.6, 0.9)):
        ours.score_map[3, 3] = here
        theirs = OpenCVSearch(3, 3, score, 0, ours.score_map, 0.1)
        said[name] = search.differences(ours, theirs, "fft")
    for name, method in (("few places", "sampled"), ("other sizes", "fft")):
        said[name] = search.differences(replace(ours, score_map=None), theirs, method)
    snapshot(said)


WITHOUT_DISPARITY = (MatchKind.AT_EDGE, MatchKind.NOTHING)
TRUTHS = {"right": 6.2, "wrong": 15.0, "unknown": math.nan}


@cache
def match_of(kind: MatchKind) -> MatchExplanation:
    """Return a match of the given kind, with a disparity of about 6 px and searched from 0 to 23 px."""
    matcher = sl.CorrelationMatcher(window_size=11, search=sl.SearchArea.rectified(24))
    seen = replace(
        explain_match(matcher, *shifted_pair(60, 100, 0, -6), 30, 60),
        offset=(0.0, 0.0),
        runner_up=(0, -20),
        peak_score=0.3 if kind in (MatchKind.BARE, MatchKind.UNLIKE) else 0.9,
        runner_up_score=0.89 if kind is MatchKind.REPEATS else 0.5,
        valley=0.0,
        flank_score=0.89 if kind is MatchKind.SMOOTH else 0.6,
        score_tolerance=0.027,
        contrast=0.05 if kind is MatchKind.BARE else 0.8,
        at_edge=kind is MatchKind.AT_EDGE,
    )
    seen = replace(seen, peak=None) if kind is MatchKind.NOTHING else seen
    assert seen.kind is kind
    return seen


def said_of(kind: MatchKind, outcome: str, reason: sl.Reason | None, visible: bool) -> str:
    seen = match_of(kind)
    kept = {sl.Reason.MEASURED: seen.disparity, sl.Reason.FILLED: 11.0}.get(reason or sl.Reason.SPECKLE, math.nan)
    return depth.match_verdict(seen, TRUTHS[outcome], visible=visible, reason=reason, disparity=kept)


def test_matches(snapshot: Snapshot) -> None:
    said = {kind.value: [said_of(kind, outcome, None, True) for outcome in TRUTHS] for kind in MatchKind}
    clear, repeats = match_of(MatchKind.CLEAR), match_of(MatchKind.REPEATS)
    said["hidden"] = [said_of(MatchKind.CLEAR, "wrong", None, False)]
    said["in the map"] = [
        *(said_of(MatchKind.CLEAR, "right", reason, True) for reason in sl.Reason),
        said_of(MatchKind.CLEAR, "wrong", sl.Reason.SPECKLE, True),
        depth.match_verdict(clear, 6.0, reason=sl.Reason.MEASURED, disparity=7.5),
    ]
    said["without a runner-up"] = [depth.match_in_words(replace(clear, runner_up=None, runner_up_score=math.nan))]
    valleys = [replace(repeats, valley=one) for one in (-0.3, 0.8)]
    said["a deep valley and a shallow one"] = [depth.match_in_words(one) for one in valleys]
    elsewhere = ((repeats, 20.3), (match_of(MatchKind.AT_EDGE), 40.0))
    said["the truth elsewhere"] = [depth.match_verdict(one, truth) for one, truth in elsewhere]
    snapshot(said)


def test_no_verdict_on_a_match_contradicts_itself() -> None:
    for kind, outcome, reason, visible in product(MatchKind, TRUTHS, [None, *sl.Reason], [True, False]):
        said = said_of(kind, outcome, reason, visible)
        bold = {word for word in ("right", "wrong") if f"**{word}**" in said}
        assert bold == ({outcome} & {"right", "wrong"} if kind not in WITHOUT_DISPARITY else set())
        assert not any(word in said for word in ("chance", "luck", "nan", "  ", "decides"))
        assert ("The scores cannot tell" in said) <= (outcome == "unknown")
        assert ("as it should be" in said) <= (outcome == "wrong" and kind not in WITHOUT_DISPARITY)
        assert ("The map keeps it" in said) <= (reason == sl.Reason.MEASURED)
        assert ("blank" in said) == (reason not in (None, sl.Reason.MEASURED, sl.Reason.FILLED))
        assert (depth.HIDDEN_FROM_RIGHT in said) != visible
        assert said.rstrip("*").endswith(".")


HEALTHY = (
    findings.judge_matches(300),
    findings.judge_sides(3.2, 40.0),
    findings.judge_raw_sides(3.2, 40.0, 0.9, 0.0),
    findings.judge_raw_sides(-9.0, 8.0, 0.4, 0.5),
    findings.judge_identical(0.1, None, 1.0),
    findings.judge_identical(0.1, 12.3, 1.0),
    findings.judge_bent_rows(0.4, 0.2, (-0.5, 0.6), 1.0, None),
    findings.judge(FindingCode.ROWS, Remedy.ALIGN_ROWS, offset_px=-0.31, spread_px=0.2),
    findings.judge(FindingCode.ROTATION, Remedy.LEVEL, rotation_deg=0.02, scale=1.001),
    findings.judge_exposure(1.0, 2.0, (0.0, 200.0)),
    findings.judge(FindingCode.TEXTURE, flat_share=0.06),
    findings.judge(FindingCode.EMPTY_BORDER, left_share=0.0, right_share=0.004),
    findings.judge(FindingCode.MIRRORED, Remedy.MIRROR_RIGHT, count=0),
    findings.judge_layout(None),
    findings.judge(FindingCode.ABOVE_EACH_OTHER, Remedy.TURN_UPRIGHT, quarters=0),
    *findings.judge_moments(None),
    judge_range(Diagnosis((), (2.0, 50.0), (0, 64)), 0, 64),
)
ILL = (
    findings.judge_matches(12),
    findings.judge_matches(0),
    findings.judge_sides(-40.0, -3.0),
    findings.judge_raw_sides(-90.0, -3.0, 0.0, 0.9),
    findings.judge_identical(0.0, None, 1.0),
    findings.judge_identical(0.01, 0.1, 1.0),
    findings.judge_bent_rows(3.5, 0.3, (-5.5, 4.1), 1.0, None),
    findings.judge_bent_rows(3.5, 0.3, (-5.5, 4.1), 1.0, (0.4, -0.2)),
    findings.judge_bent_rows(3.5, 0.3, (-5.5, 4.1), 1.0, (0.4, 0.0)),
    findings.judge(FindingCode.ROWS, Remedy.ALIGN_ROWS, offset_px=3.04, spread_px=0.2),
    findings.judge(FindingCode.ROWS, Remedy.ALIGN_ROWS, offset_px=-3.04, spread_px=0.2),
    findings.judge(FindingCode.ROTATION, Remedy.LEVEL, rotation_deg=-1.0, scale=0.98),
    findings.judge_exposure(0.6, -5.0, (0.0, 200.0)),
    findings.judge(FindingCode.TEXTURE, flat_share=0.5),
    findings.judge(FindingCode.EMPTY_BORDER, left_share=0.031, right_share=0.12),
    findings.judge(FindingCode.MIRRORED, Remedy.MIRROR_RIGHT, count=240),
    findings.judge_layout(Layout.OVER_UNDER),
    findings.judge_layout(Layout.HALF_BESIDE),
    findings.judge(FindingCode.ABOVE_EACH_OTHER, Remedy.TURN_UPRIGHT, quarters=1),
    *findings.judge_moments(Epipole(0.58, 0.46)),
    findings.judge_moments(None, 3.14)[0],
    judge_range(Diagnosis((), (2.0, 50.0), (0, 64)), 0, 16),
    judge_range(Diagnosis((), (2.0, 15.0), (0, 16), 24.0), 0, 48),
    judge_range(Diagnosis((), (2.0, 2.4), (-3, 16)), -3, 256),
)


def test_findings(snapshot: Snapshot) -> None:
    def told(judged: Sequence[Finding]) -> list[str]:
        remedies = [depth.remedy_in_words(one) for one in judged]
        assert [bool(remedy) for remedy in remedies] == [one.remedy is not None for one in judged]
        return [
            f"{one.code}: {finding_in_words(one)}{f' [{remedy}]' if remedy else ''}"
            for one, remedy in zip(judged, remedies, strict=True)
        ]

    assert all(one.healthy for one in HEALTHY) and not any(one.healthy for one in ILL)
    raw, straight = RowEvidence(11.9, 0.19, 190, 157), RowEvidence(0.19, float("nan"), 157, 3)
    rectified = [
        RectificationDecision(True, False, True, None, raw).in_words(),
        RectificationDecision(False, True, False, None, straight).in_words(),
    ]
    snapshot(
        {
            "healthy": told(HEALTHY),
            "ill": told(ILL),
            "count": [depth.problems_in_words(1), depth.problems_in_words(3)],
            "rectified": rectified,
        }
    )


def test_every_code_has_words() -> None:
    assert {one.code for one in HEALTHY} == {one.code for one in ILL} == {*FindingCode}
    assert {one.remedy for one in ILL} - {None} == {*Remedy}
    assert {*REMEDIES_DONE} == {*Remedy} - {Remedy.SET_RANGE}
    assert {*verdicts.REASON_WORDS} == {*sl.Reason}
    assert {*depth.REASONS_EXPLAINED} == {*sl.Reason} - {sl.Reason.MEASURED}
    assert {*depth.HOVER_WORDS["kinds"]} == {*MatchKind}
    assert {*depth.EXAMPLE_LABELS} == {*depth.NO_EXAMPLE} == {*ExampleKind}
    of_lag, of_search = ({*get_args(one.model_fields["method"].annotation)} for one in (LagSearch, TemplateQuery))
    assert {*sentences.LAG_METHODS} == {*sentences.LAG_METHODS_EXPLAINED} == {*sentences.CURVES} == of_lag
    assert {*sentences.TEMPLATE_METHODS} == {*sentences.TEMPLATE_METHODS_EXPLAINED} == of_search


def test_alternatives_of_depth_maps(snapshot: Snapshot) -> None:
    disparity = np.tile(np.linspace(10, 50, 200, dtype=np.float32), (100, 1))
    disparity[:, :50] = np.nan
    disparity[0, 199] = 900  # an outlier does not widen the range
    reason = np.full((10, 10), sl.Reason.MEASURED, np.uint8)
    reason[0] = sl.Reason.AMBIGUOUS
    reason[1, :4] = sl.Reason.SPECKLE
    measured = np.full((2, 2), sl.Reason.MEASURED, np.uint8)
    truth, map_of_five = np.zeros((1, 5), np.float32), np.array([[0, 1, 3, np.nan, 0]], np.float32)
    curves = {
        "One": CoverageCurve(np.array([0.25, 0.5, 1.0]), np.array([1.0, 2.0, 8.0])),
        "Other": CoverageCurve(np.array([0.8]), np.array([9.0])),
    }
    scene = uploads.texture(60, 90)
    seen = explain_match(sl.CorrelationMatcher(window_size=11), scene[:, :-5], scene[:, 5:], 30, 40)
    snapshot(
        {
            "map": depth.map_in_words(disparity),
            "empty map": depth.map_in_words(np.full((8, 8), np.nan, np.float32)),
            "photograph": depth.photograph_in_words(scene),
            "blanks": depth.all_blanks_in_words({"One": reason, "Other": measured}),
            "errors": depth.errors_in_words(map_of_five, truth, "the ground truth"),
            "differences": [
                depth.difference_in_words(np.array([0.5, 2, -2, np.nan, 0], np.float32)),
                depth.difference_in_words(np.array([np.nan], np.float32)),
            ],
            "error over coverage": depth.coverage_curves_in_words(curves),
            "scores": [depth.scores_in_words(seen, "Scores"), depth.fit_in_words(seen)],
        }
    )


def test_settings_and_windows(snapshot: Snapshot) -> None:
    start, other = sl.StereoBM(), sl.StereoBM(block_size=11)
    trials = (
        suggestion.Trial(other, 25, 3.1, whole=False),
        suggestion.Trial(other, 26.8, 3.2, whole=True),
        suggestion.Trial(sl.StereoBM(block_size=9), 31, -1, whole=True),
    )
    outcomes = [Outcome.AS_GOOD, Outcome.BETTER, Unjudged.TOO_LITTLE_MEASURED, Unjudged.JUDGES_ITSELF]
    found = [Suggestion(start, other, one, Criterion.ESTIMATED_BAD_2, 26.8, 30.0, trials) for one in outcomes]
    found.append(replace(found[1], finished=False))
    found.append(Suggestion(start, start, Outcome.AS_GOOD, Criterion.TRUE_BAD_2, 30.0, 30.0))
    values = [None, True, 0.95, 9, "zncc", MedianFilter()]
    windows = [(3, 1, 0.95), (60, 1, 0.99), (48, 1, 0.98), (255, 1, 0.999), (300, 300, 0.0)]
    grids = [(window_grid((300, 300), Box(0, 0, size, size), step), asked) for size, step, asked in windows]
    snapshot(
        {
            "outcome of a search": [depth.suggestion_in_words(one) for one in found],
            "a search so far": [depth.search_so_far(one) for one in found[-2:]],
            "values of settings": [depth.value_in_words(one) for one in values],
            "overlap of windows": [depth.overlap_in_words(grid, asked) for grid, asked in grids],
        }
    )
