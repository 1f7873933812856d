"""The sequence that the page of driving works on: the example, or the visitor's own videos and frames."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from stereolag.doctor import diagnose
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.scaling import calibration_for
from stereolag.limits import limits
from stereolag.reading import read_calibration
from stereolag.reading.videos import VIDEO_ENDINGS
from stereolag.samples import drives
from stereolag.sequences import StereoFrame, StereoSequence, example_sequence, open_sequence
from stereolag.ui import prose
from stereolag.ui.choices import show_awaited, show_limits
from stereolag.ui.depth.calibrating import ask_calibration
from stereolag.ui.persistence import persistent
from stereolag.ui.states import show_refused
from stereolag.ui.uploads import expect_uploads, forget_together, put_together, refused, upload

KEY = "driving"
EXAMPLE, ONE, TWO = "example", "one", "two"
ORIGINS = {EXAMPLE: "Example", ONE: "Your ZIP, or side-by-side video", TWO: "Your two videos"}
USUAL_DISPARITIES = 64
LOOKED_AT = 10
"""Frames at the beginning, one of which must be readable."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A sequence and what is known of it.

    Attributes
    ----------
    sequence
        Its frames.
    first
        The first frame that can be read.
    digest
        Tells it from all others.
    calibration
        Of the left camera.
    range
        The first disparity to search, and how many.
    example
        Whether it is the bundled one, whose maps all visitors may share.
    """

    sequence: StereoSequence
    first: StereoFrame
    digest: str
    calibration: Calibration | None
    range: tuple[int, int]
    example: bool = False


def ask_drive() -> Drive | None:
    """Ask for frames and calibration; None while they are not there."""
    origin = st.segmented_control(
        "Frames",
        [*ORIGINS],
        default=EXAMPLE,
        format_func=ORIGINS.__getitem__,
        required=True,
        **persistent(f"{KEY}.origin"),
        label_visibility="collapsed",
    )
    example = next(iter(drives().values()))
    if origin == EXAMPLE:
        prose.caption(example.description)
        return _example(example.name)
    expect_uploads()
    found = _ask_one() if origin == ONE else _ask_two()
    show_limits(_limits())
    calibration = ask_calibration(KEY)
    if found is None and refused():
        # What the example gives must not stand below a file that was refused.
        return None
    if found is None:
        show_awaited("your frames are" if origin == ONE else "both videos are", example.title)
        return _example(example.name)
    sequence, digest = found
    kept: Drive | None = st.session_state.get(f"{KEY}.drive")
    if kept is None or kept.digest != digest:
        first = sequence.first_readable(LOOKED_AT)
        if first is None:
            show_refused(
                f"None of the first {LOOKED_AT} frames can be read. Check that left and right images belong together."
            )
            return None
        suggested = diagnose(first.left, first.right).suggested_range
        kept = Drive(sequence, first, digest, None, suggested or (0, USUAL_DISPARITIES))
        st.session_state[f"{KEY}.drive"] = kept
    rows, cols = kept.first.left.shape[:2]
    fitted = None if calibration is None else calibration_for(calibration.content, cols, rows)
    return Drive(kept.sequence, kept.first, kept.digest, fitted, kept.range)


@st.cache_resource(show_spinner="Loading the example …")
def _example(name: str) -> Drive:
    example = drives()[name]
    sequence = example_sequence(example)
    calibration = read_calibration(example.calibration)
    searched = (0, example.num_disparities)
    return Drive(sequence, sequence.frame(0), f"example {name}", calibration, searched, example=True)


def _limits() -> str:
    most = limits()
    return (
        f"A file may have {st.get_option('server.maxUploadSize')} MB and {most.max_frames:,} frames, a video "
        f"{most.max_video_s // 60} minutes."
    )


def _ask_one() -> tuple[StereoSequence, str] | None:
    given = upload(
        "ZIP of left/ and right/, or a side-by-side video",
        open_sequence,
        key=f"{KEY}.one",
        types=("zip", *sorted(VIDEO_ENDINGS)),
        note="In a ZIP, folders or names tell the side: left/000.png and right/000.png. In a video, the left image "
        "is in the left half.",
    )
    return None if given is None else (given.content, given.digest)


def _ask_two() -> tuple[StereoSequence, str] | None:
    columns = st.columns(2, gap="medium")
    with columns[0]:
        left = upload("Left video", bytes, key=f"{KEY}.left", types=sorted(VIDEO_ENDINGS))
    with columns[1]:
        right = upload("Right video", bytes, key=f"{KEY}.right", types=sorted(VIDEO_ENDINGS))
    key = f"{KEY}.two"
    if left is None or right is None:
        forget_together(key)
        return None
    digest = f"{left.digest} {right.digest}"
    kept: tuple[StereoSequence, str] | None = st.session_state.get(key)
    if kept is not None and kept[1] == digest:
        return kept
    return put_together(lambda: (open_sequence(left.content, right.content), digest), key)
