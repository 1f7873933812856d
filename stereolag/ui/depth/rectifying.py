"""Whether a pair with the calibration of both cameras is rectified: as its rows tell, or as the visitor says."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import partial

import streamlit as st

from stereolag.doctor.row_evidence import RowEvidence, row_evidence
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import rectify
from stereolag.geometry.rig import StereoRig
from stereolag.inputs import Image
from stereolag.ui import prose
from stereolag.ui.keys import PAIR
from stereolag.ui.pairs import Change, StereoPair
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed
from stereolag.ui.sentences import rectification_in_words
from stereolag.ui.states import show_refused

DECIDE, RAW, RECTIFIED = "decide", "raw", "rectified"
CHOICES = {DECIDE: "Decide from the rows", RAW: "Raw", RECTIFIED: "Rectified already"}


@dataclass(frozen=True)
class Decision:
    """Whether a pair was rectified with its calibration and in which frame, why, and whether the visitor said so."""

    rectify: bool
    alpha: float | None
    asked: bool
    sentence: str


@dataclass(frozen=True, eq=False)
class Straightened:
    """A pair after rectification, as it is kept in memory."""

    left: Image
    right: Image
    calibration: Calibration


def choice_key(key: str) -> str:
    """Return the key of the control that asks what the images are, on the page whose keys begin with `key`."""
    return f"{key}.pictures_are"


def alpha_key(key: str) -> str:
    """Return the key of the control for what is in the frame, on the page whose keys begin with `key`."""
    return f"{key}.alpha"


def ask_rectified(pair: StereoPair, key: str = PAIR, subject: str = "The pair") -> tuple[StereoPair, Decision | None]:
    """Ask what the images of a pair are; return it as they should be matched, and what was decided.

    There is nothing to decide, and None is returned, without the calibration of both cameras before rectification.

    Parameters
    ----------
    pair
        As it was read.
    key
        What the keys of the controls begin with.
    subject
        Of the sentence that says what was decided.
    """
    if pair.calibration is None or pair.calibration.rig is None:
        return pair, None
    with st.container(horizontal=True, vertical_alignment="bottom", gap="medium"):
        st.segmented_control(
            "The images are",
            [*CHOICES],
            default=DECIDE,
            format_func=lambda choice: CHOICES[choice],
            required=True,
            **persistent(choice_key(key)),
            help="The calibration is of both cameras before rectification. Raw images are undistorted and rectified "
            "with it; images that are rectified already are left as they are.",
        )
        if pair.calibration.rig.rectification is None:
            st.slider(
                "Frame (`alpha`)",
                0.0,
                1.0,
                0.0,
                0.05,
                **persistent(alpha_key(key)),
                width=220,
                help="The calibration does not say how the pair is to be rectified (R1, R2, P1, P2). 0 keeps only what "
                "the cameras took, 1 all of it, with black around. Of images that are rectified already: what they "
                "were rectified with, for metres depend on it.",
            )
    return rectified(pair, key, subject)


def show_decision(decision: Decision, key: str = PAIR) -> None:
    """Say what was decided, with a button that undoes it."""
    undo = ("Undo", RECTIFIED) if decision.rectify else ("Rectify it all the same", RAW)
    label, choice = (CHOICES[DECIDE], DECIDE) if decision.asked else undo
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.caption(f":material/straighten: {decision.sentence}", width="content")
        st.button(label, key=f"{key}.rectifying.undo", type="tertiary", on_click=partial(_choose, key, choice))


def _choose(key: str, choice: str) -> None:
    st.session_state[choice_key(key)] = choice


def rectified(pair: StereoPair, key: str = PAIR, subject: str = "The pair") -> tuple[StereoPair, Decision | None]:
    """Return a pair as it should be matched, and what was decided, by what the visitor chose; draw no control."""
    if pair.calibration is None or pair.calibration.rig is None:
        return pair, None
    rig, choice = pair.calibration.rig, st.session_state.get(choice_key(key), DECIDE)
    alpha = st.session_state.get(alpha_key(key), 0.0) if rig.rectification is None else None
    try:
        again = _rectified(pair, alpha)
        evidence = _evidence(pair, again)
    except ValueError as error:
        show_refused(error)
        return replace(pair, calibration=None), None
    rectify_it = choice == RAW or (choice == DECIDE and not evidence.already_rectified)
    drops_truth = rectify_it and pair.truth is not None
    sentence = rectification_in_words(evidence, rectify_it, choice != DECIDE, drops_truth, subject)
    decision = Decision(rectify_it, alpha, choice != DECIDE, sentence)
    if not rectify_it:
        return pair.after(Change("", sentence), calibration=again.calibration), decision
    images = {"left": again.left, "right": again.right, "truth": None, "visible": None}
    change = Change(f"rectified {_fingerprint(rig, alpha)}", sentence)
    return pair.after(change, **images, calibration=again.calibration), decision


def _rectified(pair: StereoPair, alpha: float | None) -> Straightened:
    """Return the pair rectified with its calibration, from memory where that was done before."""
    assert pair.calibration is not None
    assert pair.calibration.rig is not None
    calibration = pair.calibration
    return computed(
        "rectified pair",
        lambda progress: Straightened(*rectify(pair.left, pair.right, calibration, alpha=alpha)),
        inputs=pair.digest,
        settings=_fingerprint(pair.calibration.rig, alpha),
        shared=pair.shared,
        label="Rectifying the pair …",
    )


def _evidence(pair: StereoPair, again: Straightened) -> RowEvidence:
    """Return what the rows say; the frame, which changes their scale a little, does not change that."""
    assert pair.calibration is not None
    assert pair.calibration.rig is not None
    return computed(
        "row evidence",
        lambda progress: row_evidence((pair.left, pair.right), (again.left, again.right)),
        inputs=pair.digest,
        settings=_fingerprint(pair.calibration.rig, None),
        shared=pair.shared,
        label="Comparing the rows …",
    )


def _fingerprint(rig: StereoRig, alpha: float | None) -> str:
    """Return what tells this way of rectifying a pair from all others."""
    arrays = [rig.left_matrix, rig.left_distortion, rig.right_matrix, rig.right_distortion, rig.rotation]
    arrays.append(rig.translation)
    if rig.rectification is not None:
        how = rig.rectification
        arrays += [how.left_rotation, how.right_rotation, how.left_projection, how.right_projection]
    numbers = b"".join(array.tobytes() for array in arrays)
    return hashlib.sha256(numbers + repr((rig.width, rig.height, alpha)).encode()).hexdigest()[:16]
