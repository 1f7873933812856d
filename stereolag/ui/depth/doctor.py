"""The input doctor: its findings on the pair, and a button for each remedy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import streamlit as st

from stereolag.assess.diagnosis import (
    Diagnosis,
    Finding,
    FindingCode,
    Remedy,
    diagnose,
    estimate_diagnosis,
    judge_range,
)
from stereolag.pair import Change, Pair, Preparation
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui import prose
from stereolag.ui.controls import set_controls
from stereolag.ui.depth.calibrating import prepared
from stereolag.ui.depth.maps import DepthView, kept_for
from stereolag.ui.depth.sentences import (
    DOCTOR_HEALTHY,
    finding_in_words,
    problems_in_words,
    remedy_in_words,
)
from stereolag.ui.navigation import PAGES
from stereolag.ui.results import computed_before, computed_in_turn, is_heavy

CALIBRATE = "pages/4_Calibrate.py"
"""The page that calibrates the lenses and the relative pose of the cameras."""

TASK = "diagnosis"
REMEDIES_KEY = "depth.remedies"
HEALTHY = f":green[:material/stethoscope: {DOCTOR_HEALTHY}]"


def with_chosen_remedies(pair: Pair) -> Pair:
    """Return the pair with the remedies that the visitor chose for it."""
    return prepared(pair, Preparation(remedies=st.session_state.get(REMEDIES_KEY, {}).get(pair.id.untreated, ())))


def show_doctor(view: DepthView) -> None:
    """Show the doctor's findings on the pair and on the ranges searched, and a button for each remedy."""
    pair = view.pair
    diagnosis = _diagnosis(pair)
    if diagnosis is None:
        return
    advice = _advice(diagnosis, view)
    ill = [one for one in advice if not one.finding.healthy]
    if not ill and not pair.remedies:
        _show_all(advice, HEALTHY)
        return
    with st.container(border=True):
        if ill:
            prose.warning(problems_in_words(len(ill)), icon=":material/stethoscope:")
        for one in ill:
            _show(*one)
        for number, change in enumerate(pair.remedies):
            _show_remedy(pair, number, change)
        _show_all(advice, "All checks" if ill else HEALTHY)


def diagnosis_at_once(pair: Pair) -> Diagnosis | None:
    """Return the diagnosis, or None if it takes long and is not known yet; `show_doctor` then computes it."""
    if is_heavy(estimate_diagnosis(pair.left.shape, pair.left.dtype)):
        found: Diagnosis | None = computed_before(TASK, **kept_for(pair))
        return found
    return _diagnosis(pair)


def _diagnosis(pair: Pair) -> Diagnosis | None:
    """Return the diagnosis; None while the pair is being examined."""
    return computed_in_turn(
        TASK,
        lambda progress: diagnose(pair.left, pair.right),
        estimate_diagnosis(pair.left.shape, pair.left.dtype),
        **kept_for(pair),
        label="Examining the pair …",
    )


class Advice(NamedTuple):
    """A finding, and the effect of a click on its remedy."""

    finding: Finding
    apply: Callable[[], None]


def _advice(diagnosis: Diagnosis, view: DepthView) -> list[Advice]:
    """Return the findings on the pair, and one on the range: the first that is not healthy, else the first."""
    pair = view.pair
    advice = [
        Advice(finding, partial(_prescribe, pair, finding.remedy))
        for finding in diagnosis.findings
        if finding.code != FindingCode.RANGE
    ]
    searched = {result.settings: reach for result in view.results.values() if (reach := result.settings.reach())}
    ranges = [finding for reach in searched.values() if (finding := judge_range(diagnosis, *reach)) is not None]
    if ranges:
        chosen = next((finding for finding in ranges if not finding.healthy), ranges[0])
        advice.append(Advice(chosen, partial(_set_ranges, diagnosis, [*searched], pair)))
    return advice


def _set_ranges(diagnosis: Diagnosis, matchers: list[StereoMatcher], pair: Pair) -> None:
    if diagnosis.suggested_range is not None:
        for matcher in matchers:
            set_controls(matcher.with_search_range(*diagnosis.suggested_range), pair)


def _prescribe(pair: Pair, remedy: Remedy | None) -> None:
    """Record that the visitor wants this remedy; swapping swapped sides undoes the first swap instead."""
    if remedy is None:
        return
    applied = pair.id.remedies
    if remedy is Remedy.SWAP_SIDES and remedy in applied:
        _undo(pair, applied.index(remedy))
    else:
        _choose(pair, (*applied, remedy))


def _undo(pair: Pair, number: int) -> None:
    applied = pair.id.remedies
    _choose(pair, (*applied[:number], *applied[number + 1 :]))


def _choose(pair: Pair, remedies: tuple[Remedy, ...]) -> None:
    st.session_state.setdefault(REMEDIES_KEY, {})[pair.id.untreated] = remedies


def _show_all(advice: list[Advice], heading: str) -> None:
    """Show every finding in a collapsed expander."""
    with st.expander(heading):
        prose.markdown("\n\n".join(_told(one.finding) for one in advice))


def _show(finding: Finding, apply: Callable[[], None]) -> None:
    _show_line(_told(finding), remedy_in_words(finding), f"depth.doctor.{finding.remedy}", apply)
    if finding.code == FindingCode.BENT_ROWS and CALIBRATE in PAGES:
        label, icon = PAGES[CALIBRATE]
        st.page_link(CALIBRATE, label=label, icon=icon)


def _show_remedy(pair: Pair, number: int, change: Change) -> None:
    earlier = pair.remedies[:number].count(change)
    key = f"depth.doctor.undo.{change.code}" + (f".{earlier}" if earlier else "")
    _show_line(f":blue[:material/healing:] {change.sentence}", "Undo", key, partial(_undo, pair, number))


def _show_line(said: str, label: str, key: str, act: Callable[[], None]) -> None:
    """Show a sentence with a button beside it, whose click affects the whole page; without a label, no button."""
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.markdown(said, width="stretch")
        if label and st.button(label, key=key, on_click=act):
            st.rerun()


def _told(finding: Finding) -> str:
    mark = ":green[:material/check_circle:]" if finding.healthy else ":orange[:material/warning:]"
    return f"{mark} {finding_in_words(finding)}"
