"""The input doctor: its findings on the pair, a button for each remedy, and the range at which a new pair starts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial

import streamlit as st

from stereolag.assess.diagnosis import Diagnosis, diagnose, estimate_diagnosis, judge_range
from stereolag.assess.findings import Finding, FindingCode, Remedy
from stereolag.assess.sentences import finding_in_words
from stereolag.pair import Pair, PairId
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui import prose
from stereolag.ui.depth.maps import FOLD_NEXT, PAIR, DepthView, kept_for
from stereolag.ui.depth.sentences import problems_in_words, remedy_in_words
from stereolag.ui.elements import show_offer, show_remedy
from stereolag.ui.matcher_controls import DISPARITIES_AT_FIRST, default_settings, matchers_in_use, set_controls
from stereolag.ui.navigation import PAGES
from stereolag.ui.results import computed_before, computed_in_turn, is_heavy
from stereolag.ui.streamlit_inside import Container

CALIBRATE = "pages/4_Calibrate.py"
"""The page that calibrates the lenses and the relative pose of the cameras."""

TASK = "diagnosis"
REMEDIES_KEY = "depth.remedies"
HEALTHY = ":green[:material/stethoscope: **Input doctor:** no problems.]"


def chosen_remedies(untreated: str) -> tuple[Remedy, ...]:
    """Return the remedies that the visitor chose for a pair, given its :attr:`stereolag.pair.PairId.untreated`."""
    return tuple(st.session_state.get(REMEDIES_KEY, {}).get(untreated, ()))


def show_doctor(view: DepthView, line: Container) -> None:
    """Show the doctor's findings on the pair and on the ranges searched, and a button for each remedy.

    Without a problem, that is said in a `line` beside other things.
    """
    pair, diagnosis = view.pair, _diagnosis(view.pair)
    if diagnosis is None:
        return
    searched = {result.settings: reach for result in view.results.values() if (reach := result.settings.reach())}
    ranges = [finding for reach in searched.values() if (finding := judge_range(diagnosis, *reach)) is not None]
    findings = [finding for finding in diagnosis.findings if finding.code != FindingCode.RANGE]
    findings += sorted(ranges, key=lambda finding: finding.healthy)[:1]
    ill, done = [finding for finding in findings if not finding.healthy], pair.id.remedies
    with st.container(border=True) if ill or pair.remedies else nullcontext():
        if ill:
            prose.warning(problems_in_words(len(ill)), icon=":material/stethoscope:")
        for finding in ill:
            act = partial(_prescribe, pair.id, finding.remedy)
            if diagnosis.suggested_range is not None and finding.code == FindingCode.RANGE:
                act = partial(_set_all, [one.with_search_range(*diagnosis.suggested_range) for one in searched], pair)
            show_remedy(_told(finding), remedy_in_words(finding), f"depth.doctor.{finding.remedy}", act)
            if finding.code == FindingCode.BENT_ROWS:
                label, icon = PAGES[CALIBRATE]
                st.page_link(CALIBRATE, label=label, icon=icon)
        for number, change in enumerate(pair.remedies):
            earlier = pair.remedies[:number].count(change)
            key = f"depth.doctor.undo.{change.code}" + (f".{earlier}" if earlier else "")
            undo = partial(_choose, pair.id.untreated, (*done[:number], *done[number + 1 :]))
            show_remedy(f":blue[:material/healing:] {change.sentence}", "Undo", key, undo)
        with st.expander("All checks") if ill else line.popover(HEALTHY):
            prose.markdown("\n\n".join(map(_told, findings)))


def _diagnosis(pair: Pair) -> Diagnosis | None:
    """Return the diagnosis; None while the pair is being examined."""
    return computed_in_turn(
        TASK,
        lambda progress: diagnose(pair.left, pair.right),
        estimate_diagnosis(pair.left.shape, pair.left.dtype),
        **kept_for(pair),
        label="Examining the pair …",
    )


def _prescribe(pair_id: PairId, remedy: Remedy | None) -> None:
    """Record that the visitor wants this remedy; swapping swapped sides undoes the first swap instead."""
    remedies = [*pair_id.remedies]
    if remedy is Remedy.SWAP_SIDES and remedy in remedies:
        remedies.remove(remedy)
    elif remedy is not None:
        remedies.append(remedy)
    _choose(pair_id.untreated, remedies)


def _choose(untreated: str, remedies: Iterable[Remedy]) -> None:
    st.session_state.setdefault(REMEDIES_KEY, {})[untreated] = tuple(remedies)


def _told(finding: Finding) -> str:
    mark = ":green[:material/check_circle:]" if finding.healthy else ":orange[:material/warning:]"
    return f"{mark} {finding_in_words(finding)}"


# The initial settings


@dataclass(frozen=True)
class Start:
    """The initial range of a pair, px, and the initial settings of all methods, for images of this width, px.

    Attributes
    ----------
    found
        Whether the range was determined, not assumed.
    """

    min_disparity: int
    num_disparities: int
    found: bool
    settings: tuple[StereoMatcher, ...]
    width: int


def with_initial_range(pair: Pair) -> Pair:
    """Return the visitor's own pair with its initial range; for a new pair, set the controls to the initial settings.

    The range is that of its calibration, or the one the doctor found. Files added to the images later do not change
    it. The controls must not have been drawn yet.
    """
    if pair.shared:
        return pair
    start: Start | None = st.session_state.get(_start_key(pair))
    width = int(pair.left.shape[1])
    if start is None:
        found = None if pair.num_disparities is None else (pair.min_disparity, pair.num_disparities)
        if found is None:
            heavy = is_heavy(estimate_diagnosis(pair.left.shape, pair.left.dtype))
            diagnosis: Diagnosis | None = computed_before(TASK, **kept_for(pair)) if heavy else _diagnosis(pair)
            if diagnosis is None:
                return pair  # still being examined, by `show_doctor`
            found = diagnosis.suggested_range
        first, count = found or (0, DISPARITIES_AT_FIRST)
        begun = replace(pair, min_disparity=first, num_disparities=count)
        start = Start(first, count, found is not None, tuple(default_settings(one, begun) for one in METHODS), width)
        _set_all(start.settings, begun)
        st.session_state[_start_key(pair)] = start
        st.session_state[FOLD_NEXT] = True
    share = width / start.width
    first, count = math.floor(start.min_disparity * share), math.ceil(start.num_disparities * share)
    return replace(pair, min_disparity=first, num_disparities=count)


def show_start(pair: Pair) -> None:
    """Show the initial settings of the pair while they are in use, and offer to undo them."""
    start: Start | None = st.session_state.get(_start_key(pair))
    if pair.shared or start is None or not start.found or not set(matchers_in_use()) <= set(start.settings):
        return
    # As for a pair about which nothing is known.
    undo = partial(_set_all, [kind().with_search_range(0, DISPARITIES_AT_FIRST) for kind in METHODS], pair)
    said = (
        f"Searched from {start.min_disparity} to {start.min_disparity + start.num_disparities - 1} px: the range found "
        "for this pair, with the fast preset."
    )
    show_offer(said, "Undo these settings", "depth.start.undo", undo, ":material/auto_fix_high:")


def _set_all(settings: Iterable[StereoMatcher], pair: Pair) -> None:
    for matcher in settings:
        set_controls(matcher, pair)


def _start_key(pair: Pair) -> str:
    return f"{PAIR}.start.{pair.id.chosen}"
