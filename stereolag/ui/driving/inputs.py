"""The inputs of the driving page: the example or the visitor's own frames, the methods, and the range they search."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import streamlit as st

from stereolag import Calibration, Diagnosis, StereoBM, StereoSGBM, preset, read_calibration
from stereolag.assess.findings import Finding, Remedy
from stereolag.assess.layout import Layout
from stereolag.assess.sentences import finding_in_words
from stereolag.core.inputs import as_stereo_pair
from stereolag.core.jobs import limits
from stereolag.geometry.rectification import calibration_for
from stereolag.io.sources import bundle, is_archive
from stereolag.io.videos import VIDEO_SUFFIXES, GuardedVideo, usual_interval
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
from stereolag.ui.matcher_controls import DEFAULT_DISPARITIES, matchers_in_use
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
FRAMES_TRIED = 10
"""Number of frames at the start of a drive, of which at least one must be readable."""

_Frames = tuple[StereoSequence, StereoFrame | None]
"""A sequence, and its first readable frame or None."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A sequence, the pair of its first readable frame, and the input doctor's diagnosis of several frames.

    Calibration and range of the first frame apply to all frames. The bundled drive has no diagnosis.
    """

    sequence: StereoSequence
    first: Pair
    diagnosis: Diagnosis | None = None

    def doubts(self, matchers: Iterable[StereoMatcher]) -> tuple[Finding, ...]:
        """Return the findings that make maps doubtful, including one about the range that these methods search."""
        if self.diagnosis is None:
            return ()
        return self.diagnosis.over(next((matcher.search_range() for matcher in matchers), None)).doubts


def ask_drive(call_off: Callable[[], None]) -> Drive:
    """Ask for frames and calibration; return the example while frames are missing, stop if they are refused.

    `call_off` is called when the visitor chooses frames from elsewhere.
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
    return own_or_example(
        next(iter(drives())) if origin == EXAMPLE else OWN,
        _own_drive,
        _example,
        drives(),
        key=KEY,
        awaited="your frames are",
    )


def _own_drive() -> Drive | None:
    is_live = st.session_state[ORIGIN] == LIVE
    recorded = _record() if is_live else None
    with st.container(horizontal=True, key="folds"):
        frames = recorded if is_live else _ask_files()
        place = st.expander("Calibration (optional): for depth in metres, and to rectify")
    calibration = ask_calibration(KEY, place)
    return None if frames is None else _with_calibration(frames, calibration)


def _with_calibration(given: Upload[_Frames], calibration: Calibration | None) -> Drive | None:
    """Return a drive with its calibration, rectified if its first frame is raw, and the range that its frames need."""
    sequence, frame = given.content
    if frame is None:
        refuse(
            f"No frame can be read among the first {min(FRAMES_TRIED, len(sequence))}: their pictures are damaged or "
            "have no partner. Check the files, and that names or folders tell left from right."
        )
        return None
    rows, cols = frame.left.shape[:2]
    fitted = None
    if calibration is not None:
        with refusals_shown("{} The drive is processed without the calibration."):
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
            label="Examining a few frames …",
        )
    needed = None if diagnosis is None else diagnosis.suggested_range
    if pair.calibration is not None and pair.calibration.num_disparities is not None:
        needed = 0, pair.calibration.num_disparities
    first, count = needed or (0, None)
    return Drive(sequence, replace(upright(pair), min_disparity=first, num_disparities=count), diagnosis)


def turn_key(pair: Pair) -> str:
    """Return the session-state key of the number of quarter turns of a drive's frames that the visitor asked for."""
    return f"{KEY}.turn.{pair.digest}"


@st.cache_resource(show_spinner="Loading the example …")
def _example(name: str) -> Drive:
    example = drives()[name]
    sequence = example_sequence(example)
    left, right, truth = sequence.frame(0)
    return Drive(
        sequence,
        Pair(
            left,
            right,
            PairId(f"example {name}"),
            truth=truth,
            calibration=read_calibration(example.calibration),
            num_disparities=example.num_disparities,
            description=example.description,
            shared=True,
        ),
    )


def _opened(*files: bytes, layout: Layout | None = None) -> _Frames:
    sequence = open_uploads(*files, layout=None if is_archive(files[0]) else layout)
    return sequence, sequence.first_readable(FRAMES_TRIED)


@in_fold(KEY)
def _ask_files() -> Upload[_Frames] | None:
    frames = _ask_one_file() if st.session_state[ORIGIN] == ONE else _ask_two_videos()
    _show_limits()
    return frames


def _show_limits() -> None:
    server = limits()
    show_limits(
        f"At most {st.get_option('server.maxUploadSize')} MB and {server.max_frames:,} frames per file, and "
        f"{server.max_video_s // 60} minutes per video."
    )


def _ask_one_file() -> Upload[_Frames] | None:
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
    """Return the bytes of a video, checked before the other video is uploaded; ValueError if they are not a video."""
    GuardedVideo(data)
    return data


def _ask_two_videos() -> Upload[_Frames] | None:
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
    """The frames recorded from a live camera, each as the JPEGs of both views; limited like an upload."""

    frames: list[Recorded] = field(default_factory=list)
    size: int = 0

    def add(self, message: Recorded) -> bytes:
        """Add a frame.

        Raises
        ------
        ValueError
            If a view is not a JPEG, or the recording is as large as it may be.
        """
        for view in message.parts:
            frame(view, grey=True)
        size = self.size + sum(map(len, message.parts))
        if size > st.get_option("server.maxUploadSize") * 2**20 or len(self.frames) >= limits().max_frames:
            raise ValueError("The recording has reached the limit of this server. Finish it.")
        self.frames.append(message)
        self.size = size
        return packed_item({"count": len(self.frames)}).data

    def finished(self) -> Upload[_Frames] | None:
        """Return the recorded drive; None if it has no frames."""
        if not self.frames:
            return None
        pictures = {
            f"{number:06d}_{side}.jpg": view
            for number, message in enumerate(self.frames)
            for side, view in zip(("left", "right"), message.parts, strict=True)
        }
        sequence, first = _opened(bundle(pictures))
        times_s = np.array([message.at - self.frames[0].at for message in self.frames]) / 1000
        rate = 1 / (usual_interval(times_s) or 1 / sequence.frame_rate)
        timed = replace(sequence, frame_rate=rate, intervals=times_s * rate)
        return Upload(f"recorded {time.time_ns()}", (timed, first))


def _record() -> Upload[_Frames] | None:
    """Ask for a camera, in one line so that the maps stay in view, and return the last drive recorded with it."""
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
    """Show the problems of the drive, and offer to turn its frames if the cameras stand one above the other.

    A click reruns the whole page.
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
                "Turn all frames by 90° for matching (distances become relative)"
                if finding.remedy is Remedy.TURN_UPRIGHT
                else "",
                f"{KEY}.turn",
                partial(st.session_state.update, {turn: int(finding.numbers.get("quarters", 0))}),
            )
        if turn in st.session_state:
            show_remedy(
                ":blue[:material/healing:] Both pictures of each frame are turned by 90° for matching, and the map is "
                "turned back.",
                "Undo",
                f"{KEY}.turn.undo",
                partial(st.session_state.pop, turn, None),
            )


# The settings

OFFERED: dict[str, tuple[str, StereoMatcher]] = {
    "fast": ("Convolution, fast", preset("fast")),
    "accurate": ("Semi-global, accurate", preset("accurate")),
    "bm": ("StereoBM", StereoBM()),
    "sgbm": ("StereoSGBM", StereoSGBM()),
}
"""The titles and the settings of the methods; their search range is set on the page."""
TRUTH_TITLE = "True disparity"
MOTION_TITLE = "Optical flow"
NO_MOTION, COLOURS, ARROWS = "off", "colours", "arrows"
MOTIONS = {NO_MOTION: "Off", COLOURS: "Flow in colours", ARROWS: "Flow as arrows"}
MAX_DISPARITY_PX = 256
"""Disparities stored in KITTI's PNG are below this, px."""
DISPARITY_BLOCK = 16
"""OpenCV's methods search multiples of this number of disparities; it is also the fewest that the page allows."""


class DriveSettings(NamedTuple):
    """The settings for the maps of a sequence; the keys of `matchers` are valid folder names."""

    matchers: dict[str, StereoMatcher]
    truth_in_video: bool
    sequence: SequenceSettings


def ask_methods(drive: Drive) -> DriveSettings:
    """Ask for the methods and for the range that they search."""
    offered = OFFERED | {
        f"own_{matcher.short_name}": (f"{matcher.title}, as on the depth page", matcher)
        for matcher in matchers_in_use()
    }
    lowest, needed = drive.first.min_disparity, drive.first.num_disparities or DEFAULT_DISPARITIES
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
    if end > MAX_DISPARITY_PX:
        prose.warning(
            f"In these frames disparities reach up to about {end} px; the maps of a drive end at {MAX_DISPARITY_PX} px."
            " Use frames of half the size, or take single frames to the depth page."
        )
    matchers = {}
    for name in chosen:
        title, matcher = offered[name]
        with refusals_shown(f"{title}: {{}}"):
            matchers[name] = matcher.with_search_range(first, count)
    motion = _ask_motion(drive)
    for note in drive.sequence.notes:
        prose.caption(note, width="content")
    truth = drive.sequence.has_truth and st.toggle(TRUTH_TITLE, **persistent(f"{KEY}.truth"))
    field = SequenceSettings.model_fields["steadiness"]
    steady = st.toggle(str(field.title), help=field.description, **persistent(f"{KEY}.steadiness"))
    return DriveSettings(matchers, truth, SequenceSettings(motion=motion, steadiness=Steadiness() if steady else None))


def _ask_range(digest: str, lowest: int, needed: int) -> tuple[int, int]:
    """Ask for the first disparity and the number of disparities, within the limits of the map files."""
    first = st.number_input(
        "Smallest disparity, px",
        0,
        MAX_DISPARITY_PX - DISPARITY_BLOCK,
        min(max(0, lowest), MAX_DISPARITY_PX - DISPARITY_BLOCK),
        **persistent(f"{KEY}.first.{digest}"),
        width=HALF_WIDTH,
    )
    max_count = (MAX_DISPARITY_PX - first) // DISPARITY_BLOCK * DISPARITY_BLOCK
    key = f"{KEY}.count.{digest}"
    if st.session_state.get(key, max_count) > max_count:
        st.session_state[key] = max_count
    count = st.number_input(
        "Disparities searched",
        DISPARITY_BLOCK,
        max_count,
        min(max(DISPARITY_BLOCK, needed), max_count),
        DISPARITY_BLOCK,
        **persistent(key),
        help=f"The maps of a drive are stored in KITTI’s format, which allows disparities up to {MAX_DISPARITY_PX} px.",
        width=HALF_WIDTH,
    )
    return first, count


def _ask_motion(drive: Drive) -> SequenceMotion | None:
    """Ask whether and how to show motion; None: not at all."""
    shown = st.segmented_control(
        "Motion",
        [*MOTIONS],
        default=NO_MOTION,
        format_func=MOTIONS.__getitem__,
        required=True,
        **persistent(f"{KEY}.motion"),
        help="Optical flow since the previous frame, by correlation in two dimensions; with a calibration, also the "
        "car’s own speed, and moving objects outlined with their speed. It takes about a second per frame.",
    )
    if shown == NO_MOTION:
        return None
    rate = drive.sequence.frame_rate
    if drive.first.calibration is None:
        prose.caption("Speeds and moving objects need metres: add a calibration above.", width="content")
    else:
        rate = st.number_input(
            "Frames per second",
            0.1,
            10_000.0,
            float(rate),
            **persistent(f"{KEY}.rate.{drive.first.digest}"),
            help="Frame rate of the camera. Speeds are only as accurate as this number. Image files do not state it; "
            "10 is assumed for them.",
        )
    return SequenceMotion(arrows=shown == ARROWS, frame_rate=rate)


def title_of(name: str) -> str:
    """Return the title of a method, shown above its maps; `name` is its key in :class:`DriveSettings`."""
    own_titles = {f"own_{method.short_name}": method.title for method in METHODS}
    return own_titles[name] if name in own_titles else OFFERED[name][0]
