"""The maps of a sequence, computed in the background: the job, its cancellation and resumption, and the player."""

from __future__ import annotations

import hashlib
import io
import math
import threading
import zipfile
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple, cast

import streamlit as st
from cachetools import LRUCache

from stereolag.core.jobs import Estimate
from stereolag.core.typography import duration
from stereolag.figures.legends import Legend, disparity_legends, wheel_legend
from stereolag.figures.pictures import VIRIDIS
from stereolag.motion.flow import FlowMatcher
from stereolag.sequences import SequenceResult, SequenceState, SequenceVideo, run_sequence
from stereolag.sequences.frames import MOTION, SequenceMemory, table_lines
from stereolag.sequences.video import VideoPieces, whole_video
from stereolag.ui import prose
from stereolag.ui.background_jobs import Job, show_busy, this_visit, watch
from stereolag.ui.components import component, deliver, packed_item
from stereolag.ui.depth.live import transfer
from stereolag.ui.downloads import download_button
from stereolag.ui.driving.inputs import EXAMPLE, KEY, MOTION_TITLE, ORIGIN, TRUTH_TITLE, Drive, DriveSettings, title_of
from stereolag.ui.elements import announce, show_refused
from stereolag.ui.navigation import DEPTH_PAGE, failures_answered
from stereolag.ui.sentences import MOTION_IN_WORDS

WORK = f"{KEY}.work"
FRAMES_AT_ONCE = 4
"""Number of frames whose pictures and maps are in memory together."""

_examples: LRUCache[str, DriveWork] = LRUCache(2)  # some 40 MB each
"""Results for the example, by name of the work: computed for one visitor, shown to the next at once."""
_examples_lock = threading.Lock()


@dataclass(eq=False)
class DriveWork:
    """The work on a sequence so far.

    Attributes
    ----------
    name
        Digest of the sequence and the settings.
    kept, video
        Maps, figures and pictures so far; in memory, like everything a visitor uploads.
    state
        Progress; None before the first report.
    starts
        Number of times it was started.
    abandoned
        Whether it was cancelled because the visitor turned to other frames.
    job
        The job that does the work.
    """

    name: str
    kept: SequenceMemory
    video: VideoPieces
    state: SequenceState | None = None
    starts: int = 1
    abandoned: bool = False
    job: Job[SequenceResult] = field(init=False)

    @property
    def video_name(self) -> str:
        """Return the name that identifies the video, 32 characters."""
        return hashlib.sha256(f"{self.name} {self.starts}".encode()).hexdigest()[:32]


def work_on(drive: Drive, asked: DriveSettings) -> DriveWork:
    """Return the work on a sequence with these settings; start it if there is none, in place of any other."""
    matchers = [f"{name} {matcher.model_dump_json()}" for name, matcher in asked.matchers.items()]
    others = map(repr, (drive.first.calibration, asked.truth_in_video, asked.sequence, drive.sequence.turn))
    name = hashlib.sha256("\0".join([drive.first.digest, *others, *matchers]).encode()).hexdigest()
    current: DriveWork | None = st.session_state.get(WORK)
    if current is not None and current.name == name:
        if current.abandoned and st.session_state[ORIGIN] == EXAMPLE:
            resume(current, drive, asked)
        return cast(DriveWork, st.session_state[WORK])
    if current is not None:
        current.job.cancel()
    with _examples_lock:
        work = _examples.get(name)
    work = work or _started(DriveWork(name, SequenceMemory(), VideoPieces(drive.sequence.frame_rate)), drive, asked)
    st.session_state[WORK] = work
    return work


def call_off() -> None:
    """Cancel the work for a visitor who turns to other frames; work on the example resumes when they return to it."""
    work: DriveWork | None = st.session_state.get(WORK)
    if work is not None and work.job.running:
        work.job.cancel()
        work.abandoned = True


def resume(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    """Resume cancelled work: finished frames are drawn again, not computed again."""
    again = DriveWork(work.name, work.kept, VideoPieces(drive.sequence.frame_rate), starts=work.starts + 1)
    st.session_state[WORK] = _started(again, drive, asked)


def _started(work: DriveWork, drive: Drive, asked: DriveSettings) -> DriveWork:
    """Start the job of some work, and return the work."""

    def compute(job: Job[SequenceResult]) -> SequenceResult:
        try:
            result = run_sequence(
                replace(drive.sequence, findings=drive.doubts(asked.matchers.values())),
                asked.matchers,
                work.kept,
                calibration=drive.first.calibration,
                settings=asked.sequence,
                video=SequenceVideo(work.video, with_truth=asked.truth_in_video),
                progress=partial(setattr, work, "state"),
                cancelled=lambda: job.cancelled,
            )
        finally:
            work.video.close()
        if drive.first.shared and not result.cancelled:
            with _examples_lock:
                _examples[work.name] = work
        return result

    work.job = Job(compute, estimate(drive, asked))
    this_visit().jobs[WORK] = work.name, work.job
    return work


def estimate(drive: Drive, asked: DriveSettings) -> Estimate:
    """Return the cost of computing the maps of all frames."""
    left = drive.first.left
    costs = [matcher.estimate(left.shape, left.dtype) for matcher in asked.matchers.values()]
    costs += [FlowMatcher().estimate(left.shape, left.dtype)] if asked.sequence.motion else []
    frame_bytes = 2 * left.nbytes + 13 * left.shape[0] * left.shape[1]  # both images, and 13 bytes per pixel of a map
    return Estimate(
        memory=max(cost.memory for cost in costs) + FRAMES_AT_ONCE * frame_bytes,
        seconds=len(drive.sequence) * math.fsum(cost.seconds for cost in costs),
    )


# The player


class Chart(NamedTuple):
    """A chart of the timeline: a figure of each frame, times `scale`, over the frames."""

    name: str
    field: str
    unit: str
    digits: int
    scale: float = 1.0
    from_zero: bool = True


CHARTS = (
    Chart("Coverage", "coverage", "%", 0, 100.0, from_zero=False),
    Chart("Computing time", "milliseconds", "ms", 0),
    Chart("Nearest obstacle", "nearest_m", "m", 1),
    Chart("Nearest obstacle", "nearest_px", "px", 1),
    Chart("Wrong by over 2 px", "bad_2_percent", "%", 1),
    Chart("Flicker", "flicker_px", "px", 2),
    Chart("Own speed", "own_speed_kmh", "km/h", 0),
)


LINES = (
    {"colour": "#785bd5", "dash": ""},
    {"colour": "#d87607", "dash": "8 4"},
    {"colour": "#0ca674", "dash": "2 3"},
    {"colour": "#bd195c", "dash": "8 3 2 3"},
)
"""The line style of each method; the dashes (of an SVG, px) tell lines apart for colour-blind viewers."""


def show_player(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    """Show the player; `OPENED` is set to the number of the frame that the visitor wants to see on the depth page."""
    key = f"{KEY}.player"
    done = not work.job.running  # asked before the pieces are counted: once it is done, no more come
    pieces, computed = [*work.video.pieces], work.video.collected
    data = _figures(work, drive, asked) | {
        "name": work.video_name,
        "titles": [
            "Left image",
            *map(title_of, asked.matchers),
            *([TRUTH_TITLE] if asked.truth_in_video else []),
            *([MOTION_TITLE] if asked.sequence.motion else []),
        ],
        "height": drive.first.left.shape[0],
        "width": drive.first.left.shape[1],
        "rate": drive.sequence.frame_rate,
        "frames": len(drive.sequence),
        "pieces": len(pieces),
        "computed": computed,
        "done": done,
        "legends": [asdict(legend) for legend in _legends(work, drive, asked)],
    }
    with st.container(gap=None):
        for number, piece in enumerate(pieces):
            name = f"{work.video_name} {number}"
            deliver(
                packed_item({"kind": "video", "name": name, "digest": name}, [piece]).data, key=f"{key}.piece.{number}"
            )
        component("player")(
            key=key, data=data, on_opened_change=lambda: st.session_state.update({OPENED: st.session_state[key].opened})
        )


def _figures(work: DriveWork, drive: Drive, asked: DriveSettings) -> dict[str, Any]:
    """Return the problem of each frame so far, "" if it has none, and the charts, None where a figure is unknown."""
    count, records = len(drive.sequence), [*work.kept.records.values()]
    titles = {name: title_of(name) for name in asked.matchers} | (
        {MOTION: MOTION_TITLE} if asked.sequence.motion else {}
    )
    problems = [""] * count
    for record in records:
        if record.problem:
            problems[record.number] = (
                MOTION_IN_WORDS[record.problem]
                if record.method == MOTION
                else f"{record.name} is left out: {record.problem}"
            )
    charts: dict[str, dict[str, Any]] = {}
    for chart in CHARTS:
        values: dict[str, list[float | None]] = {method: [None] * count for method in titles}
        for record in records:
            value = getattr(record, chart.field) * chart.scale
            if math.isfinite(value):
                values[record.method][record.number] = round(value, 3)
        # Each method keeps its place, and so its colour, even if others have no values.
        series = [
            {"title": title, "values": values[method], **LINES[place % len(LINES)]}
            for place, (method, title) in enumerate(titles.items())
            if any(value is not None for value in values[method])
        ]
        if series and chart.name not in charts:  # in metres if known, otherwise in pixels
            charts[chart.name] = {
                "name": chart.name,
                "unit": chart.unit,
                "digits": chart.digits,
                "from_zero": chart.from_zero,
                "series": series,
            }
    return {"problems": problems, "charts": [*charts.values()]}


# The result so far

OPENED = f"{KEY}.opened"
"""Session-state key of the number of the frame to open on the depth page."""


def show_work(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    """Show the work so far, and refresh it while it is being computed."""

    def show() -> None:
        _show_progress(work, drive, asked)
        show_player(work, drive, asked)
        frame = st.session_state.pop(OPENED, None)
        if frame is not None:
            _open_on_depth_page(drive, int(frame))

    watch(work.job, show)


def _legends(work: DriveWork, drive: Drive, asked: DriveSettings) -> tuple[Legend, ...]:
    if work.kept.colours is None:
        return ()
    legends = disparity_legends(*work.kept.colours, VIRIDIS, drive.first.calibration)
    if work.kept.largest_motion is None or asked.sequence.motion is None or asked.sequence.motion.arrows:
        return legends
    return *legends, wheel_legend("motion since the previous frame", work.kept.largest_motion)


def _show_progress(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    state, total = work.state, len(drive.sequence)
    with st.container(horizontal=True, vertical_alignment="center", key=f"{KEY}.progress"):
        if work.job.running:
            done = state.done if state else 0
            to_go = f", about {state.remaining_s:,.0f} s to go" if state and not math.isnan(state.remaining_s) else ""
            show_busy(
                work.job,
                f"{done:,} of {total:,} frames{to_go}",
                key=f"{KEY}.cancel",
                done=done / total,
                ending="Stops here; finished frames are kept, and you can resume later.",
            )
            return
        with failures_answered(), suppress(CancelledError):
            work.job.result()
        if state is None:
            return
        rate = state.done / state.elapsed_s if state.elapsed_s else 0.0
        damaged = f", {state.damaged:,} of them damaged or without a partner" if state.damaged else ""
        announce(f"{state.done:,} of {total:,} frames are done.")
        prose.caption(
            f"{state.done:,} of {total:,} frames in {duration(state.elapsed_s)}{damaged}: **{rate:.1f} a second**, "
            "decoded, matched, coloured and encoded.",
            width="content",
        )
        if state.done < total:
            st.button("Resume", key=f"{KEY}.go_on", on_click=resume, args=(work, drive, asked))


def _open_on_depth_page(drive: Drive, number: int) -> None:
    try:
        frame = drive.sequence.frame(number)
    except (ValueError, OSError) as error:
        show_refused(f"Frame {number + 1} cannot be opened: {error}")
        return
    transfer(
        frame,
        f"{drive.first.digest} {number}",
        f"Frame {number + 1} of the drive.",
        drive.first.calibration,
        (drive.first.min_disparity, drive.first.num_disparities),
    )
    st.switch_page(DEPTH_PAGE)


def show_downloads(work: DriveWork, drive: Drive) -> None:
    """Offer the video, the maps and the table."""
    if work.job.running or not work.video.pieces:
        return
    with st.container(horizontal=True, gap="small"):
        download_button(
            "Video (MP4)",
            lambda: whole_video(work.video.pieces),
            "drive.mp4",
            "video/mp4",
            key=f"{KEY}.mp4",
            icon=":material/movie:",
        )
        download_button(
            "Maps (ZIP)",
            lambda: _maps(work, drive),
            "drive_disparity.zip",
            "application/zip",
            key=f"{KEY}.maps",
            icon=":material/folder_zip:",
            meaning="A folder for each method with 16-bit PNGs, px × 256 as KITTI stores them, and the table.",
        )
        download_button(
            "Table (CSV)",
            _table(work),
            "frames.csv",
            "text/csv",
            key=f"{KEY}.csv",
            icon=":material/table:",
        )


def _table(work: DriveWork) -> str:
    return table_lines(work.kept.records.values(), header=True)


def _maps(work: DriveWork, drive: Drive) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:  # PNGs do not compress further
        for (number, method), data in sorted(work.kept.maps.items()):
            archive.writestr(f"{method}/{drive.sequence.names[number]}.png", data)
        archive.writestr("frames.csv", _table(work))
    return file.getvalue()
