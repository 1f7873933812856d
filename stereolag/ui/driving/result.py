"""The result of a sequence: the player, the progress, and the downloads."""

from __future__ import annotations

import io
import zipfile
from concurrent.futures import CancelledError
from contextlib import suppress

import streamlit as st

from stereolag.figures.legends import Legend, disparity_legends, wheel_legend
from stereolag.figures.pictures import VIRIDIS
from stereolag.sequences.records import MOTION, header, lines
from stereolag.sequences.video import whole_video
from stereolag.ui import prose
from stereolag.ui.depth.restoring import transfer
from stereolag.ui.downloads import download_button
from stereolag.ui.driving.frames import KEY, Drive
from stereolag.ui.driving.player import VideoInfo, show_player
from stereolag.ui.driving.settings import MOTION_TITLE, DriveSettings, title_of
from stereolag.ui.driving.work import DriveWork, go_on
from stereolag.ui.elements import announce, show_refused
from stereolag.ui.navigation import failures_answered
from stereolag.ui.results import show_busy
from stereolag.ui.sentences import duration

BETWEEN_LOOKS_S = 0.5
DEPTH_PAGE = "pages/3_Depth_maps.py"
OPENED = f"{KEY}.opened"


def show_work(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    """Show the work so far, and refresh it while it is being computed."""
    st.fragment(_watch, run_every=BETWEEN_LOOKS_S if work.job.running else None)(work, drive, asked)


def _watch(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    running = work.job.running
    if not running and st.session_state.get(f"{KEY}.watched") == work.name:
        del st.session_state[f"{KEY}.watched"]
        st.rerun(scope="app")
    if running:
        st.session_state[f"{KEY}.watched"] = work.name
    _show_progress(work, drive, asked)
    video = VideoInfo(
        work.video_name,
        asked.titles,
        {name: title_of(name) for name in asked.matchers} | ({MOTION: MOTION_TITLE} if asked.motion else {}),
        (drive.first.left.shape[0], drive.first.left.shape[1]),
        drive.sequence.frame_rate,
        drive.sequence.names,
    )
    pieces, computed = [*work.video.pieces], work.computed
    show_player(
        video,
        pieces,
        [*work.kept.records.values()],
        computed=computed,
        done=not running,
        legends=_legends(work, drive, asked),
        key=f"{KEY}.player",
        on_open=lambda number: st.session_state.update({OPENED: number}),
    )
    if OPENED in st.session_state:
        _open_on_depth_page(drive, int(st.session_state.pop(OPENED)))


def _legends(work: DriveWork, drive: Drive, asked: DriveSettings) -> tuple[Legend, ...]:
    if work.kept.colours is None:
        return ()
    legends = disparity_legends(*work.kept.colours, VIRIDIS, drive.calibration)
    if work.kept.largest_motion is None or asked.motion is None or asked.motion.arrows:
        return legends
    return *legends, wheel_legend("motion since the previous frame", work.kept.largest_motion)


def _show_progress(work: DriveWork, drive: Drive, asked: DriveSettings) -> None:
    state, total = work.state, len(drive.sequence)
    with st.container(horizontal=True, vertical_alignment="center", key=f"{KEY}.progress"):
        if work.job.running:
            done = state.done if state else 0
            known = state is not None and state.remaining_s == state.remaining_s
            rest = f", about {state.remaining_s:,.0f} s to go" if state and known else ""
            text = f"{done} of {total} frames{rest}"
            ending = "Stops here; finished frames are kept, and you can go on later."
            show_busy(work.job, text, key=f"{KEY}.cancel", done=done / total, ending=ending)
            return
        with failures_answered(), suppress(CancelledError):
            work.job.result()
        if state is None:
            return
        rate = state.done / state.elapsed_s if state.elapsed_s else 0.0
        damaged = f", {state.damaged} of them damaged" if state.damaged else ""
        announce(f"{state.done} of {total} frames are done.")
        prose.caption(
            f"{state.done} of {total} frames in {duration(state.elapsed_s)}{damaged}: **{rate:.1f} a second**, "
            "decoded, matched, coloured and encoded.",
            width="content",
        )
        if state.done < total:
            st.button("Go on", key=f"{KEY}.go_on", on_click=go_on, args=(work, drive, asked))


def _open_on_depth_page(drive: Drive, number: int) -> None:
    try:
        frame = drive.sequence.frame(number)
    except (ValueError, OSError) as error:
        show_refused(f"Frame {number + 1} cannot be opened: {error}")
        return
    transfer(frame, f"{drive.digest} {number}", f"Frame {number + 1} of the drive.", drive.calibration, drive.range)
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
    return header() + lines(work.kept.records.values())


def _maps(work: DriveWork, drive: Drive) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:  # PNGs do not compress further
        for (number, method), data in sorted(work.kept.maps.items()):
            archive.writestr(f"{method}/{drive.sequence.names[number]}.png", data)
        archive.writestr("frames.csv", _table(work))
    return file.getvalue()
