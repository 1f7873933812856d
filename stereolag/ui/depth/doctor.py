"""The input doctor: what is wrong with the pair, in numbers, and a button for each thing that can be mended."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import streamlit as st

from stereolag.doctor.diagnosis import Diagnosis, diagnose, estimate_diagnosis, judge_range
from stereolag.doctor.findings import Ailment, Finding
from stereolag.doctor.remedies import apply_remedy
from stereolag.stereo.matcher import StereoMatcher
from stereolag.ui.depth.view import DepthView
from stereolag.ui.matcher_controls import set_controls
from stereolag.ui.pairs import Change, StereoPair
from stereolag.ui.results import computed, computed_in_turn

REMEDIES_KEY = "depth.remedies"
HEALTHY = ":green[:material/stethoscope: **Input doctor:** nothing to mend on this pair.]"

DONE = {
    Ailment.SWAPPED: "Left and right were swapped.",
    Ailment.ROWS: "The rows of the right picture were moved to match those of the left one.",
    Ailment.ROTATION: "The right picture was turned and scaled until its rows match: depth is relative.",
    Ailment.EXPOSURE: "The right picture was given the brightness and contrast of the left one.",
}


def treated(pair: StereoPair) -> StereoPair:
    """Return the pair with the remedies that the visitor chose for it."""
    for ailment in st.session_state.get(REMEDIES_KEY, {}).get(pair.source, ()):
        try:
            pair = _mended(pair, ailment)
        except ValueError as error:
            st.error(str(error))
    return pair


def show_doctor(view: DepthView) -> None:
    """Show what the doctor finds on the pair and in the ranges searched, and what a click would mend."""
    pair = view.pair
    diagnosis = computed_in_turn(
        "diagnosis",
        lambda progress: diagnose(pair.left, pair.right),
        estimate_diagnosis(pair.left.shape, pair.left.dtype),
        inputs=pair.digest,
        settings="",
        shared=pair.shared,
        label="Examining the pair …",
    )
    if diagnosis is None:
        return
    advice = _advice(diagnosis, view)
    ill = [one for one in advice if not one.finding.healthy]
    if not ill and not pair.remedies:
        _show_all(advice, HEALTHY)
        return
    with st.container(border=True):
        if ill:
            st.warning(f"**Input doctor:** {_counted(len(ill))} on this pair.", icon=":material/stethoscope:")
        for one in ill:
            _show(one)
        for number, remedy in enumerate(pair.remedies):
            _show_remedy(pair, number, remedy)
        _show_all(advice, "All that was looked at" if ill else HEALTHY)


class Advice(NamedTuple):
    """A finding, and what a click on its remedy does."""

    finding: Finding
    mend: Callable[[], None]


def _advice(diagnosis: Diagnosis, view: DepthView) -> list[Advice]:
    """Return the findings on the pair, and on the range of the first method whose range is not good."""
    pair = view.pair
    advice = [
        Advice(finding, partial(_prescribe, pair, finding.ailment))
        for finding in diagnosis.findings
        if finding.ailment != Ailment.RANGE
    ]
    judged = [
        (judge_range(diagnosis, *searched), matcher)
        for matcher in (result.settings for result in view.results.values())
        if (searched := matcher.search_range()) is not None
    ]
    ranges = [finding for finding, _ in judged if finding is not None]
    if ranges:
        chosen = next((finding for finding in ranges if not finding.healthy), ranges[0])
        advice.append(Advice(chosen, partial(_set_ranges, diagnosis, [matcher for _, matcher in judged], pair)))
    return advice


def _set_ranges(diagnosis: Diagnosis, matchers: list[StereoMatcher], pair: StereoPair) -> None:
    for matcher in matchers:
        set_controls(matcher.with_search_range(diagnosis.suggested_min, diagnosis.suggested_num), pair)


def _prescribe(pair: StereoPair, ailment: Ailment) -> None:
    """Note that the visitor wants this remedy; swapping what was swapped is no remedy but undoes the other."""
    given = _given(pair)
    if ailment == Ailment.SWAPPED and ailment in given:
        _undo(pair, given.index(ailment))
    else:
        st.session_state.setdefault(REMEDIES_KEY, {})[pair.source] = (*given, ailment)


def _undo(pair: StereoPair, number: int) -> None:
    given = _given(pair)
    st.session_state.setdefault(REMEDIES_KEY, {})[pair.source] = (*given[:number], *given[number + 1 :])


def _given(pair: StereoPair) -> tuple[Ailment, ...]:
    """Return against which ailments the pair was given a remedy."""
    return tuple(Ailment(remedy.name) for remedy in pair.remedies)


def _mended(pair: StereoPair, ailment: Ailment) -> StereoPair:
    """Return the pair after one remedy; what is known of it is kept where it still holds."""
    return computed(
        "remedy",
        lambda progress: _with_remedy(pair, ailment),
        inputs=pair.digest,
        settings=ailment,
        shared=pair.shared,
        label="Mending the pair …",
    )


def _with_remedy(pair: StereoPair, ailment: Ailment) -> StereoPair:
    left, right = apply_remedy(pair.left, pair.right, ailment)
    done = DONE[ailment]
    if ailment == Ailment.SWAPPED and pair.truth is not None:
        done += " The true disparity belongs to the other picture and is left out."
    change = Change(ailment, done, remedy=True)
    if ailment == Ailment.SWAPPED:
        return pair.after(change, left=left, right=right, truth=None, visible=None)
    if ailment == Ailment.ROTATION:
        return pair.after(change, left=left, right=right, calibration=None)
    return pair.after(change, left=left, right=right)


def _show_all(advice: list[Advice], heading: str) -> None:
    """Show every finding, folded away under a heading."""
    with st.expander(heading):
        st.markdown("\n\n".join(f"{_mark(one.finding)} {one.finding.sentence}" for one in advice))


def _show(advice: Advice) -> None:
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        st.markdown(f"{_mark(advice.finding)} {advice.finding.sentence}", width="stretch")
        if advice.finding.remedy:
            _button(advice.finding.remedy, f"depth.doctor.{advice.finding.ailment}", advice.mend)


def _show_remedy(pair: StereoPair, number: int, remedy: Change) -> None:
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        st.markdown(f":blue[:material/healing:] {remedy.sentence}", width="stretch")
        earlier = pair.remedies[:number].count(remedy)
        key = f"depth.doctor.undo.{remedy.name}" + (f".{earlier}" if earlier else "")
        _button("Undo", key, partial(_undo, pair, number))


def _button(label: str, key: str, act: Callable[[], None]) -> None:
    """Draw a button that changes what the whole page works on, not this part alone."""
    if st.button(label, key=key, on_click=act):
        st.rerun()


def _mark(finding: Finding) -> str:
    return ":green[:material/check_circle:]" if finding.healthy else ":orange[:material/warning:]"


def _counted(count: int) -> str:
    return "one finding" if count == 1 else f"{count} findings"
