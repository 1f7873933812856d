"""The sequence of the driving page: the example, or the visitor's own videos and frames."""

from __future__ import annotations

from dataclasses import dataclass, replace

import streamlit as st

from stereolag.assess.diagnosis import diagnose
from stereolag.core.inputs import as_stereo_pair
from stereolag.core.jobs import limits
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import calibration_for
from stereolag.io.calibrations import read_calibration
from stereolag.io.videos import VIDEO_ENDINGS
from stereolag.pair import Pair, PairId
from stereolag.samples import drives
from stereolag.sequences import RectifiedSequence, StereoFrame, StereoSequence, example_sequence
from stereolag.sequences.sources import open_uploads
from stereolag.ui import prose
from stereolag.ui.choices import show_awaited, show_limits
from stereolag.ui.controls import persistent
from stereolag.ui.depth.calibrating import (
    ask_calibration,
    ask_rectification,
    chosen_preparation,
    prepared,
    show_decision,
)
from stereolag.ui.elements import show_refused
from stereolag.ui.results import computed
from stereolag.ui.uploads import Upload, expect_uploads, forget_together, put_together, refused, upload

KEY = "driving"
EXAMPLE, ONE, TWO = "example", "one", "two"
ORIGINS = {EXAMPLE: "Example", ONE: "Your ZIP, or side-by-side video", TWO: "Your two videos"}
LOOKED_AT = 10
"""Number of frames at the beginning, one of which must be readable."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A sequence, and the pair of its first readable frame: what is known of that holds for all frames."""

    sequence: StereoSequence
    first: Pair

    @property
    def digest(self) -> str:
        """Return the key that identifies the sequence."""
        return self.first.digest

    @property
    def calibration(self) -> Calibration | None:
        """Return the calibration of the rectified frames."""
        return self.first.calibration

    @property
    def range(self) -> tuple[int, int] | None:
        """Return the first disparity and the number of disparities that the frames need, px; None if unknown."""
        pair = self.first
        return None if pair.num_disparities is None else (pair.min_disparity, pair.num_disparities)

    @property
    def example(self) -> bool:
        """Return whether it is the bundled example, whose maps all visitors may share."""
        return self.first.shared


def ask_drive() -> Drive | None:
    """Ask for frames and calibration; return the example while frames are missing, None if they are refused."""
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
        # Do not show results of the example below a refused file.
        return None
    if found is None:
        show_awaited("your frames are" if origin == ONE else "both videos are", example.title)
        return _example(example.name)
    sequence, digest = found
    first = _first_readable(sequence, digest)
    return None if first is None else _with_calibration(sequence, first, digest, calibration)


def _first_readable(sequence: StereoSequence, digest: str) -> StereoFrame | None:
    """Return the first readable frame; if there is none, show an error and return None."""
    kept: tuple[str, StereoFrame | None] | None = st.session_state.get(f"{KEY}.first")
    if kept is None or kept[0] != digest:
        kept = digest, sequence.first_readable(LOOKED_AT)
        st.session_state[f"{KEY}.first"] = kept
    if kept[1] is None:
        show_refused(
            f"None of the first {LOOKED_AT} frames can be read. Check that left and right images belong together."
        )
    return kept[1]


def _with_calibration(
    sequence: StereoSequence, frame: StereoFrame, digest: str, calibration: Upload[Calibration] | None
) -> Drive | None:
    """Return a drive with its calibration, rectified if its first frame is raw, and the range that frame needs."""
    rows, cols = frame.left.shape[:2]
    fitted = None
    if calibration is not None:
        try:
            fitted = calibration_for(calibration.content, cols, rows)
        except ValueError as error:
            show_refused(f"{error} The drive is processed without it.")
    try:
        left, right = as_stereo_pair(frame.left, frame.right)
    except ValueError as error:
        show_refused(error)
        return None
    ask_rectification(fitted, KEY)
    pair = prepared(Pair(left, right, PairId(digest), truth=frame.truth, calibration=fitted), chosen_preparation(KEY))
    show_decision(pair, KEY, "Each frame")
    decision = pair.rectification
    if decision is not None and decision.done and fitted is not None:
        sequence = RectifiedSequence(sequence, fitted, decision.alpha)
    found = _range_of(pair)
    first, count = found or (0, None)
    return Drive(sequence, replace(pair, min_disparity=first, num_disparities=count))


def _range_of(pair: Pair) -> tuple[int, int] | None:
    """Return the first disparity and the number of disparities a frame needs; None if the input doctor cannot tell."""
    try:
        diagnosis = computed(
            "diagnosis",
            lambda progress: diagnose(pair.left, pair.right),
            inputs=pair.digest,
            settings="",
            shared=False,
            label="Looking over the first frame …",
        )
    except ValueError as error:
        show_refused(error)
        return None
    return diagnosis.suggested_range


@st.cache_resource(show_spinner="Loading the example …")
def _example(name: str) -> Drive:
    example = drives()[name]
    sequence = example_sequence(example)
    left, right, truth = sequence.frame(0)
    first = Pair(
        left,
        right,
        PairId(f"example {name}"),
        truth=truth,
        calibration=read_calibration(example.calibration),
        num_disparities=example.num_disparities,
        shared=True,
    )
    return Drive(sequence, first)


def _limits() -> str:
    most = limits()
    return (
        f"At most {st.get_option('server.maxUploadSize')} MB and {most.max_frames:,} frames per file, and "
        f"{most.max_video_s // 60} minutes per video."
    )


def _ask_one() -> tuple[StereoSequence, str] | None:
    given = upload(
        "ZIP of left/ and right/, or a side-by-side video",
        open_uploads,
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
    return put_together(lambda: (open_uploads(left.content, right.content), digest), key)
