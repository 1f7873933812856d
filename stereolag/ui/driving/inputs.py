"""What the driving page computes: the example or the visitor's own frames, the methods, and the range they search."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import streamlit as st

from stereolag import Calibration, Diagnosis, StereoBM, StereoSGBM, preset, read_calibration
from stereolag.assess.findings import Finding, Remedy
from stereolag.assess.layout import Layout
from stereolag.assess.sentences import finding_in_words
from stereolag.core.inputs import as_stereo_pair
from stereolag.core.jobs import limits
from stereolag.geometry.rectification import calibration_for
from stereolag.io.sources import bundle, is_archive
from stereolag.io.videos import VIDEO_SUFFIXES, GuardedVideo
from stereolag.pair import Pair, PairId, upright
from stereolag.samples import drives
from stereolag.sequences import (
    SequenceMotion,
    SequenceSettings,
    Steadiness,
    StereoFrame,
    StereoSequence,
    diagnose_sequence,
    example_sequence,
    rectified_sequence,
)
from stereolag.sequences.sources import open_uploads
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS
from stereolag.ui import prose
from stereolag.ui.components import packed_item
from stereolag.ui.controls import persistent
from stereolag.ui.depth.live import ask_camera, ask_layout, stereo_camera
from stereolag.ui.depth.preparing import (
    ask_calibration,
    ask_rectification,
    chosen_preparation,
    prepared,
    show_decision,
)
from stereolag.ui.depth.sentences import problems_in_words
from stereolag.ui.elements import in_columns, refusals_shown, show_remedy
from stereolag.ui.matcher_controls import matchers_in_use
from stereolag.ui.navigation import HALF_WIDTH, head, show_try_first
from stereolag.ui.results import computed, kept_for
from stereolag.ui.streams import Message, frame, open_stream
from stereolag.ui.uploads import (
    LIVE,
    OWN,
    Upload,
    in_fold,
    no_files_yet,
    own_or_example,
    put_together,
    refuse,
    show_limits,
    upload,
)

KEY = "driving"
ORIGIN = f"{KEY}.origin"
EXAMPLE, ONE, TWO = "example", "one", "two"
ORIGINS = {
    EXAMPLE: "Example",
    ONE: "Your ZIP, or side-by-side video",
    TWO: "Your two videos",
    LIVE: "Your camera",
}
LOOKED_AT = 10
"""Number of frames at the beginning, one of which must be readable."""


_Frames = tuple[StereoSequence, StereoFrame | None]
"""A sequence, and its first readable frame, None if there is none."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A sequence, the pair of its first readable frame, and what the input doctor found on several frames.

    What is known of the first frame holds for all; only bundled drives are not examined.
    """

    sequence: StereoSequence
    first: Pair
    diagnosis: Diagnosis | None = None

    def doubts(self, matchers: Iterable[StereoMatcher]) -> tuple[Finding, ...]:
        """Return the findings that make maps doubtful, also about the range that these methods search."""
        if self.diagnosis is None:
            return ()
        return self.diagnosis.over(next((one.search_range() for one in matchers), None)).doubts

    @property
    def range(self) -> tuple[int, int] | None:
        """Return the first disparity and the number of disparities that the frames need, px; None if unknown."""
        pair = self.first
        return None if pair.num_disparities is None else (pair.min_disparity, pair.num_disparities)


def ask_drive(call_off: Callable[[], None]) -> Drive:
    """Ask for frames and calibration; return the example while frames are missing, stop if they are refused.

    What is computed is called off when the visitor turns to other frames.
    """
    with head("Driving"):
        origin = st.segmented_control(
            "Frames",
            [*ORIGINS],
            default=EXAMPLE,
            format_func=ORIGINS.__getitem__,
            required=True,
            **persistent(ORIGIN),
            label_visibility="collapsed",
            on_change=call_off,
        )
        show_try_first("play it, and drag along the curves below the pictures.")
    no_files_yet(KEY)
    chosen = next(iter(drives())) if origin == EXAMPLE else OWN
    return own_or_example(chosen, _own, _example, drives(), key=KEY, awaited="your frames are")


def _own() -> Drive | None:
    is_live = st.session_state[ORIGIN] == LIVE
    recorded = _record() if is_live else None
    with st.container(horizontal=True, key="folds"):
        found = recorded if is_live else _ask_files()
        place = st.expander("Calibration (optional): for depth in metres, and to rectify")
    calibration = ask_calibration(KEY, place)
    return None if found is None else _with_calibration(found, calibration)


def _with_calibration(given: Upload[_Frames], calibration: Calibration | None) -> Drive | None:
    """Return a drive with its calibration, rectified if its first frame is raw, and the range that its frames need."""
    sequence, frame = given.content
    if frame is None:
        refuse(f"None of the first {LOOKED_AT} frames can be read. Check that left and right images belong together.")
        return None
    rows, cols = frame.left.shape[:2]
    fitted = None
    if calibration is not None:
        with refusals_shown("{} The drive is processed without it."):
            fitted = calibration_for(calibration, cols, rows)
    try:
        left, right = as_stereo_pair(frame.left, frame.right)
    except ValueError as error:
        refuse(str(error))
        return None
    ask_rectification(fitted, KEY)
    pair = prepared(
        Pair(left, right, PairId(given.digest), truth=frame.truth, calibration=fitted), chosen_preparation(KEY)
    )
    show_decision(pair, KEY, "Each frame")
    decision = pair.rectification
    if decision is not None and decision.done and fitted is not None:
        sequence = rectified_sequence(sequence, fitted, decision.alpha)
    else:
        sequence = replace(sequence, turn=pair.turn or st.session_state.get(turn_key(pair), 0))
    diagnosis = None
    with refusals_shown():
        diagnosis = computed(
            "diagnosis of a drive",
            lambda progress: diagnose_sequence(sequence),
            **kept_for(pair, str(sequence.turn)),
            label="Looking over a few frames …",
        )
    found = None if diagnosis is None else diagnosis.suggested_range
    if pair.calibration is not None and pair.calibration.num_disparities is not None:
        found = 0, pair.calibration.num_disparities
    first, count = found or (0, None)
    return Drive(sequence, replace(upright(pair), min_disparity=first, num_disparities=count), diagnosis)


def turn_key(pair: Pair) -> str:
    """Return the key of the quarters by which the visitor has the frames of a drive turned to be matched."""
    return f"{KEY}.turn.{pair.digest}"


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
        description=example.description,
        shared=True,
    )
    return Drive(sequence, first)


def _opened(*files: bytes, layout: Layout | None = None) -> _Frames:
    sequence = open_uploads(*files, layout=None if is_archive(files[0]) else layout)
    return sequence, sequence.first_readable(LOOKED_AT)


@in_fold(KEY)
def _ask_files() -> Upload[_Frames] | None:
    found = _ask_one() if st.session_state[ORIGIN] == ONE else _ask_two()
    _show_limits()
    return found


def _show_limits() -> None:
    most = limits()
    show_limits(
        f"At most {st.get_option('server.maxUploadSize')} MB and {most.max_frames:,} frames per file, and "
        f"{most.max_video_s // 60} minutes per video."
    )


def _ask_one() -> Upload[_Frames] | None:
    layout = ask_layout(KEY)
    return upload(
        "ZIP of left/ and right/, or a video with both views",
        partial(_opened, layout=layout),
        key=f"{KEY}.one",
        types=("zip", *sorted(VIDEO_SUFFIXES)),
        note="In a ZIP, folders or names tell the side: left/000.png and right/000.png. In a video, one view is "
        "beside or above the other.",
        variant=layout and f" {layout}",
    )


def _video(data: bytes) -> bytes:
    """Return the bytes of a video; ValueError if they are none, before the other video is there."""
    GuardedVideo(data)
    return data


def _ask_two() -> Upload[_Frames] | None:
    left, right = (
        upload(f"{side} video", _video, key=f"{KEY}.{side.lower()}", types=sorted(VIDEO_SUFFIXES))
        for side in in_columns(("Left", "Right"))
    )
    if left is None or right is None:
        return put_together(None, f"{KEY}.two")
    digest = f"{left.digest} {right.digest}"
    return put_together(lambda: Upload(digest, _opened(left.content, right.content)), f"{KEY}.two", digest)


class Recorded(Message):
    """A frame: the JPEGs of both views, and the time of its capture, ms."""

    parts: tuple[bytes, bytes]
    at: float


@dataclass(eq=False)
class Recording:
    """The frames that a live camera has recorded, each as the JPEGs of both views, within the limits of an upload."""

    frames: list[Recorded] = field(default_factory=list)
    size: int = 0

    def add(self, message: Recorded) -> bytes:
        """Add a frame.

        Raises
        ------
        ValueError
            A view that is no JPEG, or a frame too many.
        """
        for view in message.parts:
            frame(view, grey=True)
        size = self.size + sum(map(len, message.parts))
        if size > st.get_option("server.maxUploadSize") * 2**20 or len(self.frames) >= limits().max_frames:
            raise ValueError("The recording is as large as a file may be here. Finish it.")
        self.frames.append(message)
        self.size = size
        return packed_item({"count": len(self.frames)}).data

    def finished(self) -> Upload[_Frames] | None:
        """Return the drive that was recorded, None if it has no frame."""
        if not self.frames:
            return None
        packed = bundle(
            {
                f"{number:06d}_{side}.jpg": view
                for number, message in enumerate(self.frames)
                for side, view in zip(("left", "right"), message.parts, strict=True)
            }
        )
        sequence, first = _opened(packed)
        lasted_s = (self.frames[-1].at - self.frames[0].at) / 1000
        rate = (len(self.frames) - 1) / lasted_s if lasted_s > 0 else sequence.frame_rate
        return Upload(f"recorded {time.time_ns()}", (replace(sequence, frame_rate=rate), first))


def _record() -> Upload[_Frames] | None:
    """Ask for a camera in one line, so that the maps stay in view, and return the last drive recorded with it."""
    line = st.container(horizontal=True, gap="medium", vertical_alignment="bottom")
    with line:
        camera = ask_camera(f"{KEY}.camera")
    stream = open_stream(KEY, Recorded)
    recording: Recording = stream.kept.setdefault("recording", Recording())
    stream.answer = recording.add

    def finish() -> None:
        stream.kept["drive"] = recording.finished() or stream.kept.get("drive")
        stream.kept["recording"] = Recording()

    with line.container():
        stereo_camera(stream, camera, key=f"{KEY}.live", record=True, on_recorded_change=finish)
    _show_limits()
    return stream.kept.get("drive")


def show_findings(drive: Drive, matchers: Iterable[StereoMatcher]) -> None:
    """Show what is wrong with the drive, and offer to turn the frames of cameras above each other.

    A click affects the whole page.
    """
    doubts, turn = drive.doubts(matchers), turn_key(drive.first)
    if not doubts and turn not in st.session_state:
        return
    with st.container(border=True, key=f"{KEY}.findings"):
        if doubts:
            prose.warning(problems_in_words(len(doubts), "drive"), icon=":material/stethoscope:")
        for finding in doubts:
            show_remedy(
                f":orange[:material/warning:] {finding_in_words(finding)}",
                TURN_FRAMES if finding.remedy is Remedy.TURN_UPRIGHT else "",
                f"{KEY}.turn",
                partial(st.session_state.update, {turn: int(finding.numbers.get("quarters", 0))}),
            )
        if turn in st.session_state:
            show_remedy(
                ":blue[:material/healing:] Both pictures of each frame are turned by a quarter to be matched, and the "
                "map is turned back.",
                "Undo",
                f"{KEY}.turn.undo",
                partial(st.session_state.pop, turn, None),
            )


TURN_FRAMES = "Turn all frames to match them (distances become relative)"

# The settings

OFFERED: dict[str, tuple[str, StereoMatcher]] = {
    "fast": ("Convolution, fast", preset("fast")),
    "accurate": ("Semi-global, accurate", preset("accurate")),
    "bm": ("StereoBM", StereoBM()),
    "sgbm": ("StereoSGBM", StereoSGBM()),
}
"""The titles and the settings of the methods, but for their range."""
TRUTH_TITLE = "True disparity"
MOTION_TITLE = "Optical flow"
NO_MOTION, COLOURS, ARROWS = "off", "colours", "arrows"
MOTIONS = {NO_MOTION: "Off", COLOURS: "Flow in colours", ARROWS: "Flow as arrows"}
MOST = 256
"""Disparities stored in KITTI's PNG are below this, px."""
FEWEST = 16
USUAL_DISPARITIES = 64
"""Number of disparities searched if the range is unknown."""


class DriveSettings(NamedTuple):
    """The settings for the maps of a sequence; the names of the methods are valid folder names."""

    matchers: dict[str, StereoMatcher]
    truth_in_video: bool = False
    motion: SequenceMotion | None = None
    steadiness: Steadiness | None = None


def ask_methods(drive: Drive) -> DriveSettings:
    """Ask for the methods and for the range that they search."""
    own = {f"own_{one.short_name}": (f"{one.title}, as on the depth page", one) for one in matchers_in_use()}
    lowest, needed = drive.range or (0, USUAL_DISPARITIES)
    offered = OFFERED | own
    chosen = st.pills(
        "Methods",
        [*offered],
        selection_mode="multi",
        default=("fast", "bm"),
        format_func=lambda name: offered[name][0],
        **persistent(f"{KEY}.methods"),
        wrap=True,
    )
    with st.container(horizontal=True, gap="small"):
        first, count = _ask_range(drive.first.digest, lowest, needed)
    if lowest < 0:
        prose.warning(
            f"In these frames disparities reach down to about {lowest} px; the maps of a drive begin at 0 px. "
            "Rectify the frames so that infinity has disparity 0, or take single frames to the depth page."
        )
    end = lowest + needed
    if end > MOST:
        prose.warning(
            f"In these frames disparities reach up to about {end} px; the maps of a drive end at {MOST} px. Give "
            "frames of half the size, or take single frames to the depth page."
        )
    found = {}
    for name in chosen:
        title, matcher = offered[name]
        with refusals_shown(f"{title}: {{}}"):
            found[name] = matcher.with_search_range(first, count)
    motion = _ask_motion(drive)
    for note in drive.sequence.notes:
        prose.caption(note, width="content")
    truth = drive.sequence.has_truth and st.toggle(TRUTH_TITLE, **persistent(f"{KEY}.truth"))
    field = SequenceSettings.model_fields["steadiness"]
    steady = st.toggle(str(field.title), help=field.description, **persistent(f"{KEY}.steadiness"))
    return DriveSettings(found, truth, motion, Steadiness() if steady else None)


def _ask_range(digest: str, lowest: int, needed: int) -> tuple[int, int]:
    """Ask for the first disparity and the number of disparities, within the limits of the map files."""
    first = st.number_input(
        "Smallest disparity, px",
        0,
        MOST - FEWEST,
        min(max(0, lowest), MOST - FEWEST),
        **persistent(f"{KEY}.first.{digest}"),
        width=HALF_WIDTH,
    )
    # OpenCV's methods search whole blocks of 16, which must fit too.
    most = (MOST - first) // FEWEST * FEWEST
    key = f"{KEY}.count.{digest}"
    if st.session_state.get(key, most) > most:
        st.session_state[key] = most
    count = st.number_input(
        "Disparities searched",
        FEWEST,
        most,
        min(max(FEWEST, needed), most),
        FEWEST,
        **persistent(key),
        help=f"The maps of a drive are stored in KITTI’s format, which allows disparities up to {MOST} px.",
        width=HALF_WIDTH,
    )
    return first, count


def _ask_motion(drive: Drive) -> SequenceMotion | None:
    """Ask whether and how to show motion."""
    shown = st.segmented_control(
        "Motion",
        [*MOTIONS],
        default=NO_MOTION,
        format_func=MOTIONS.__getitem__,
        required=True,
        **persistent(f"{KEY}.motion"),
        help="Optical flow since the previous frame, by correlation in two dimensions; with a calibration, also the "
        "car’s own speed, and moving objects outlined with their speed. It takes about a second a frame.",
    )
    if shown == NO_MOTION:
        return None
    rate = drive.sequence.frame_rate
    if drive.first.calibration is None:
        prose.caption("Speeds and moving objects need metres: give a calibration above.", width="content")
    else:
        rate = st.number_input(
            "Frames a second",
            0.1,
            10_000.0,
            float(rate),
            **persistent(f"{KEY}.rate.{drive.first.digest}"),
            help="Of the camera. Speeds are only as accurate as this number; image files lack it, and 10 is assumed.",
        )
    return SequenceMotion(arrows=shown == ARROWS, frame_rate=rate)


def title_of(name: str) -> str:
    """Return the title of a method, shown above its maps."""
    titles = {f"own_{method.short_name}": method.title for method in METHODS}
    return titles[name] if name in titles else OFFERED[name][0]
