"""The preparation of a pair: its calibration, its rectification, the input doctor's remedies, and the initial range.

The pages Depth maps and Driving both ask for a calibration (files, two numbers, or the one made on the page Calibrate)
and for the rectification. The input doctor names the problems of a pair, with a button for each remedy.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import streamlit as st

from stereolag.assess.diagnosis import Diagnosis, diagnose, estimate_diagnosis, judge_range
from stereolag.assess.findings import Finding, FindingCode, Remedy
from stereolag.assess.sentences import finding_in_words
from stereolag.geometry.calibration import UNITS, Calibration
from stereolag.io.calibrations import CALIBRATION_SUFFIXES, read_calibration
from stereolag.io.guard import guarded
from stereolag.pair import Pair, PairId, Preparation, Rows, prepare
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui import prose
from stereolag.ui.background_jobs import is_heavy
from stereolag.ui.controls import persistent
from stereolag.ui.depth.sentences import problems_in_words, remedy_in_words
from stereolag.ui.depth.view import FOLD, FOLD_NEXT, HANDED, PAIR, DepthView
from stereolag.ui.elements import show_offer, show_refused, show_remedy
from stereolag.ui.matcher_controls import DEFAULT_DISPARITIES, default_settings, matchers_in_use, set_controls
from stereolag.ui.navigation import DEPTH_PAGE, PAGES
from stereolag.ui.results import computed, computed_before, computed_in_turn, kept_for
from stereolag.ui.streamlit_inside import Container
from stereolag.ui.uploads import OWN, no_files_yet, upload_named

T = TypeVar("T")

# The calibration


def ask_calibration(key: str, place: Container) -> Calibration | None:
    """Ask in `place` for the calibration, and describe it here; None if there is none: depth is then relative."""
    with place:
        columns = st.columns([2, 1, 1], gap="medium")
        with columns[0]:
            unit = st.session_state.get(f"{key}.unit")
            given = upload_named(
                "Calibration files",
                lambda files: guarded(read_calibration)(
                    *(data for _, data in files), length_unit_m=unit and UNITS[unit]
                ),
                key=f"{key}.calibration",
                types=CALIBRATION_SUFFIXES,
                note="All files of one calibration, together or one by one. OpenCV’s YAML, XML or JSON, NPZ, ROS, "
                "Kalibr, ZED, OAK, RealSense, MATLAB, Middlebury, KITTI, DrivingStereo, DSEC, ORB-SLAM, VINS, OKVIS, "
                "Basalt, MRPT, MC-Calib, or JSON with focal_px and baseline_m. With both cameras’ matrices and "
                "distortion the pair is rectified.",
                variant=unit or "",
            )
            unknown = given is not None and unit is None and not given.content.unit_stated
            st.segmented_control(
                "Which unit are its lengths in? The file does not say." if unknown else "Lengths without a unit are in",
                [*UNITS],
                **persistent(f"{key}.unit"),
                help="OpenCV’s and NumPy’s files do not state it: it is the unit in which the chessboard’s squares "
                "were measured. Others state it, or are in metres by convention (ROS, Kalibr).",
            )
        focal = columns[1].number_input(
            "Focal length, px",
            min_value=1.0,
            value=None,
            **persistent(f"{key}.focal"),
            placeholder="from the file" if given else "not known",
            disabled=given is not None,
        )
        baseline = columns[2].number_input(
            "Baseline, m",
            min_value=0.0001,
            value=None,
            format="%.4f",
            **persistent(f"{key}.baseline"),
            placeholder="from the file" if given else "not known",
            disabled=given is not None,
            help="The distance between the two cameras.",
        )
    if given is not None:
        summary = " ".join((given.content.in_words(), *given.content.notes))
        if given.content.plausible:
            prose.caption(summary, width="content")
        else:
            prose.warning(summary)
        return given.content
    if focal is None or baseline is None:
        return _kept_calibration()
    return Calibration(focal, baseline)


OWN_CALIBRATION = "calibrate.kept"
"""Session-state key of the calibration made on the page Calibrate."""


def take_to_depth_page(calibration: Calibration) -> None:
    """Open the depth page with a calibration, ready for the visitor's own files."""
    st.session_state.update({OWN_CALIBRATION: calibration, PAIR: OWN, FOLD: True})
    st.session_state.pop(HANDED, None)
    no_files_yet(PAIR)
    st.switch_page(DEPTH_PAGE)


def _kept_calibration() -> Calibration | None:
    """Return the calibration made on the page Calibrate; say that it is in use, with a button to stop using it."""
    kept: Calibration | None = st.session_state.get(OWN_CALIBRATION)
    if kept is not None:
        error = "" if kept.rms is None else f", {kept.rms:.2f} px"
        show_offer(
            f"In use: the calibration you made on the page Calibrate{error}.",
            "Remove",
            f"{OWN_CALIBRATION}.remove",
            partial(st.session_state.pop, OWN_CALIBRATION, None),
        )
    return kept


# Raw or rectified

ROWS = {Rows.DECIDE: "Decide from the rows", Rows.RAW: "Raw", Rows.RECTIFIED: "Already rectified"}
"""The labels of the control for raw or rectified images."""


def rows_key(key: str) -> str:
    """Return the key of the control for raw or rectified images; `key` is the prefix of the page's keys."""
    return f"{key}.pictures_are"


def ask_rectification(calibration: Calibration | None, key: str) -> None:
    """Ask whether the images are raw or rectified, if the calibration describes both cameras before rectification.

    Parameters
    ----------
    calibration
        The calibration of the pair as read.
    key
        Prefix of the keys of the controls; :func:`chosen_preparation` returns the answer.
    """
    if calibration is None or calibration.rig is None:
        return
    with st.container(horizontal=True, vertical_alignment="bottom", gap="medium"):
        st.segmented_control(
            "The images are",
            [*ROWS],
            default=Rows.DECIDE,
            format_func=ROWS.__getitem__,
            required=True,
            **persistent(rows_key(key)),
            help="The calibration describes both cameras before rectification. Raw images are undistorted and "
            "rectified with it; images that are already rectified stay as they are.",
        )
        if calibration.rig.rectification is None:
            st.slider(
                "Frame (`alpha`)",
                0.0,
                1.0,
                0.0,
                0.05,
                **persistent(f"{key}.alpha"),
                width=220,
                help="The calibration does not include the rectification (R1, R2, P1, P2). 0 crops to valid pixels, "
                "1 keeps all pixels, with black around them. For images that are already rectified, choose the value "
                "they were rectified with: distances depend on it.",
            )


def chosen_preparation(key: str, divisor: int | None = 1) -> Preparation:
    """Return the preparation that the visitor chose, without remedies; `key` is the prefix of the page's keys."""
    state = st.session_state
    return Preparation(divisor, Rows(state.get(rows_key(key), Rows.DECIDE)), state.get(f"{key}.alpha", 0.0))


STEPS = {
    "resized pair": "Resizing …",
    "rectified pair": "Rectifying the pair …",
    "row evidence": "Comparing the rows …",
    "remedy": "Correcting the pair …",
}


def prepared(pair: Pair, preparation: Preparation) -> Pair:
    """Return the pair ready for matching, with each step from memory if possible; show why a step was refused."""

    def remembered_step(step: str, make: Callable[[], T], pair: Pair, settings: str) -> T:
        return computed(
            step,
            lambda progress: make(),
            **kept_for(pair, settings),
            label=STEPS[step],
        )

    return prepare(pair, preparation, memo=remembered_step, refused=show_refused)


def show_decision(pair: Pair, key: str, subject: str = "The pair") -> None:
    """Show whether the pair was rectified and why, with a button that reverses the decision."""
    decision = pair.rectification
    if decision is None:
        return
    reverse = ("Undo", Rows.RECTIFIED) if decision.done else ("Rectify it anyway", Rows.RAW)
    label, rows = (ROWS[Rows.DECIDE], Rows.DECIDE) if decision.chosen else reverse
    show_offer(
        decision.in_words(subject),
        label,
        f"{key}.rectifying.undo",
        partial(st.session_state.update, {rows_key(key): rows}),
        ":material/straighten:",
    )


# The input doctor

CALIBRATE = "pages/4_Calibrate.py"
"""The page that calibrates the lenses and the relative pose of the cameras."""

DIAGNOSIS = "diagnosis"
REMEDIES_KEY = "depth.remedies"
HEALTHY = ":green[:material/stethoscope: **Input doctor:** no problems.]"


def chosen_remedies(untreated: str) -> tuple[Remedy, ...]:
    """Return the remedies that the visitor chose for a pair; `untreated` is its :attr:`.PairId.untreated`."""
    return tuple(st.session_state.get(REMEDIES_KEY, {}).get(untreated, ()))


def show_doctor(view: DepthView, line: Container) -> None:
    """Show the doctor's findings on the pair and on the ranges searched, with a button for each remedy.

    If there is no problem, a popover in `line` says so.
    """
    pair, diagnosis = view.pair, _diagnosis(view.pair)
    if diagnosis is None:
        return
    searched = {result.settings: reach for result in view.results.values() if (reach := result.settings.reach())}
    ranges = [finding for reach in searched.values() if (finding := judge_range(diagnosis, *reach)) is not None]
    findings = [
        *(finding for finding in diagnosis.findings if finding.code != FindingCode.RANGE),
        *sorted(ranges, key=lambda finding: finding.healthy)[:1],
    ]
    problems, applied = [finding for finding in findings if not finding.healthy], pair.id.remedies
    with st.container(border=True) if problems or pair.remedies else nullcontext():
        if problems:
            prose.warning(problems_in_words(len(problems)), icon=":material/stethoscope:")
        for finding in problems:
            act = partial(_apply_remedy, pair.id, finding.remedy)
            if diagnosis.suggested_range is not None and finding.code == FindingCode.RANGE:
                act = partial(
                    _set_all, [matcher.with_search_range(*diagnosis.suggested_range) for matcher in searched], pair
                )
            show_remedy(_marked(finding), remedy_in_words(finding), f"depth.doctor.{finding.remedy}", act)
            if finding.code == FindingCode.BENT_ROWS:
                label, icon = PAGES[CALIBRATE]
                st.page_link(CALIBRATE, label=label, icon=icon)
        for number, change in enumerate(pair.remedies):
            earlier = pair.remedies[:number].count(change)
            key = f"depth.doctor.undo.{change.code}" + (f".{earlier}" if earlier else "")
            show_remedy(
                f":blue[:material/healing:] {change.sentence}",
                "Undo",
                key,
                partial(_set_remedies, pair.id.untreated, (*applied[:number], *applied[number + 1 :])),
            )
        with st.expander("All checks") if problems else line.popover(HEALTHY):
            prose.markdown("\n\n".join(map(_marked, findings)))


def _diagnosis(pair: Pair) -> Diagnosis | None:
    """Return the diagnosis; None while the pair is being examined."""
    return computed_in_turn(
        DIAGNOSIS,
        lambda progress: diagnose(pair.left, pair.right),
        estimate_diagnosis(pair.left.shape, pair.left.dtype),
        **kept_for(pair),
        label="Examining the pair …",
    )


def _apply_remedy(pair_id: PairId, remedy: Remedy | None) -> None:
    """Add a remedy to those of a pair; a second swap of the sides undoes the first instead."""
    remedies = [*pair_id.remedies]
    if remedy is Remedy.SWAP_SIDES and remedy in remedies:
        remedies.remove(remedy)
    elif remedy is not None:
        remedies.append(remedy)
    _set_remedies(pair_id.untreated, remedies)


def _set_remedies(untreated: str, remedies: Iterable[Remedy]) -> None:
    st.session_state.setdefault(REMEDIES_KEY, {})[untreated] = tuple(remedies)


def _marked(finding: Finding) -> str:
    """Return the sentence of a finding behind a check mark or a warning sign."""
    mark = ":green[:material/check_circle:]" if finding.healthy else ":orange[:material/warning:]"
    return f"{mark} {finding_in_words(finding)}"


# The initial settings


@dataclass(frozen=True)
class InitialSettings:
    """The initial range of a pair and the initial settings of all methods.

    Attributes
    ----------
    min_disparity, num_disparities
        The range, px.
    found
        Whether the range was determined, not assumed.
    settings
        The settings of each method.
    width
        Width of the images that range and settings are for, px.
    """

    min_disparity: int
    num_disparities: int
    found: bool
    settings: tuple[StereoMatcher, ...]
    width: int


def with_initial_range(pair: Pair) -> Pair:
    """Return the visitor's own pair with its initial range; for a new pair, set the controls to the initial settings.

    The range is that of the calibration, or the one the doctor found. Files added later do not change it. The controls
    must not have been drawn yet in this run.
    """
    if pair.shared:
        return pair
    initial: InitialSettings | None = st.session_state.get(_initial_settings_key(pair))
    width = int(pair.left.shape[1])
    if initial is None:
        known = None if pair.num_disparities is None else (pair.min_disparity, pair.num_disparities)
        if known is None:
            heavy = is_heavy(estimate_diagnosis(pair.left.shape, pair.left.dtype))
            diagnosis: Diagnosis | None = computed_before(DIAGNOSIS, **kept_for(pair)) if heavy else _diagnosis(pair)
            if diagnosis is None:
                return pair  # still being examined, by `show_doctor`
            known = diagnosis.suggested_range
        first, count = known or (0, DEFAULT_DISPARITIES)
        ranged = replace(pair, min_disparity=first, num_disparities=count)
        settings = tuple(default_settings(method, ranged) for method in METHODS)
        initial = InitialSettings(first, count, known is not None, settings, width)
        _set_all(settings, ranged)
        st.session_state[_initial_settings_key(pair)] = initial
        st.session_state[FOLD_NEXT] = True
    scale = width / initial.width
    first, count = math.floor(initial.min_disparity * scale), math.ceil(initial.num_disparities * scale)
    return replace(pair, min_disparity=first, num_disparities=count)


def show_initial_settings(pair: Pair) -> None:
    """Show the range found for the pair while its initial settings are in use, and offer to undo them."""
    initial: InitialSettings | None = st.session_state.get(_initial_settings_key(pair))
    if pair.shared or initial is None or not initial.found or not set(matchers_in_use()) <= set(initial.settings):
        return
    first, last = initial.min_disparity, initial.min_disparity + initial.num_disparities - 1
    show_offer(
        f"Searched from {first} to {last} px: the range found for this pair, with the fast preset.",
        "Undo these settings",
        "depth.start.undo",
        # The settings for a pair whose range is unknown.
        partial(_set_all, [kind().with_search_range(0, DEFAULT_DISPARITIES) for kind in METHODS], pair),
        ":material/auto_fix_high:",
    )


def _set_all(settings: Iterable[StereoMatcher], pair: Pair) -> None:
    for matcher in settings:
        set_controls(matcher, pair)


def _initial_settings_key(pair: Pair) -> str:
    return f"{PAIR}.start.{pair.id.chosen}"
