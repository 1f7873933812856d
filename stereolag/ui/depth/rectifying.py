"""Whether to rectify a pair with the calibration of both cameras: decided from its rows, or by the visitor."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import partial

import streamlit as st

from stereolag.assess.orientation import RowEvidence, row_evidence
from stereolag.core.inputs import Image
from stereolag.geometry.calibration import Calibration, StereoRig
from stereolag.geometry.rectification import rectify
from stereolag.pair import ChangeCode, Pair
from stereolag.ui import prose
from stereolag.ui.keys import PAIR
from stereolag.ui.persistence import persistent
from stereolag.ui.results import computed
from stereolag.ui.sentences import rectification_in_words
from stereolag.ui.states import show_refused

DECIDE, RAW, RECTIFIED = "decide", "raw", "rectified"
CHOICES = {DECIDE: "Decide from the rows", RAW: "Raw", RECTIFIED: "Rectified already"}


@dataclass(frozen=True)
class Decision:
    """Whether a pair was rectified with its calibration, in which frame, whether the visitor chose it, and why."""

    rectify: bool
    alpha: float | None
    asked: bool
    sentence: str


@dataclass(frozen=True, eq=False)
class Straightened:
    """A pair after rectification, as kept in memory."""

    left: Image
    right: Image
    calibration: Calibration


def choice_key(key: str) -> str:
    """Return the key of the control for raw or rectified images; `key` is the prefix of the page's keys."""
    return f"{key}.pictures_are"


def alpha_key(key: str) -> str:
    """Return the key of the control for the frame; `key` is the prefix of the page's keys."""
    return f"{key}.alpha"


def ask_rectified(pair: Pair, key: str = PAIR, subject: str = "The pair") -> tuple[Pair, Decision | None]:
    """Ask whether the images of a pair are raw or rectified; return the pair ready for matching, and the decision.

    The decision is None without the calibration of both cameras before rectification: there is nothing to decide.

    Parameters
    ----------
    pair
        The pair as read.
    key
        Prefix of the keys of the controls.
    subject
        Subject of the sentence about the decision.
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
            help="The calibration describes both cameras before rectification. Raw images are undistorted and "
            "rectified with it; images that are rectified already are left as they are.",
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
                help="The calibration does not include the rectification (R1, R2, P1, P2). 0 crops to valid pixels, "
                "1 keeps all pixels, with black around them. For images that are rectified already: the value they "
                "were rectified with, as metres depend on it.",
            )
    return rectified(pair, key, subject)


def show_decision(decision: Decision, key: str = PAIR) -> None:
    """Show the decision, with a button that undoes it."""
    undo = ("Undo", RECTIFIED) if decision.rectify else ("Rectify it all the same", RAW)
    label, choice = (CHOICES[DECIDE], DECIDE) if decision.asked else undo
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        prose.caption(f":material/straighten: {decision.sentence}", width="content")
        st.button(label, key=f"{key}.rectifying.undo", type="tertiary", on_click=partial(_choose, key, choice))


def _choose(key: str, choice: str) -> None:
    st.session_state[choice_key(key)] = choice


def rectified(pair: Pair, key: str = PAIR, subject: str = "The pair") -> tuple[Pair, Decision | None]:
    """Return the pair ready for matching and the decision, given the visitor's choice; draw no control."""
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
        return pair.after(ChangeCode.RECTIFIED, sentence, calibration=again.calibration), decision
    images = {"left": again.left, "right": again.right, "truth": None, "visible": None}
    rectified_id = replace(pair.id, rectification=f"rectified {_fingerprint(rig, alpha)}")
    return pair.after(
        ChangeCode.RECTIFIED, sentence, id=rectified_id, **images, calibration=again.calibration
    ), decision


def _rectified(pair: Pair, alpha: float | None) -> Straightened:
    """Return the pair rectified with its calibration, from memory if that was done before."""
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


def _evidence(pair: Pair, again: Straightened) -> RowEvidence:
    """Return the evidence of the rows; the frame changes their scale a little, but not the outcome."""
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
    """Return a digest that identifies this rectification of a pair."""
    arrays = [rig.left_matrix, rig.left_distortion, rig.right_matrix, rig.right_distortion, rig.rotation]
    arrays.append(rig.translation)
    if rig.rectification is not None:
        how = rig.rectification
        arrays += [how.left_rotation, how.right_rotation, how.left_projection, how.right_projection]
    numbers = b"".join(array.tobytes() for array in arrays)
    return hashlib.sha256(numbers + repr((rig.width, rig.height, alpha)).encode()).hexdigest()[:16]
