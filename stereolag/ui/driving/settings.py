"""The settings of a sequence: the methods that compute its maps, and the range they search."""

from __future__ import annotations

from typing import NamedTuple

import streamlit as st

from stereolag.core.settings import SettingsError
from stereolag.sequences import SequenceMotion, SequenceSettings, Steadiness
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, preset
from stereolag.stereo.opencv import StereoBM, StereoSGBM
from stereolag.ui import prose
from stereolag.ui.controls import matchers_in_use, persistent
from stereolag.ui.driving.frames import KEY, Drive
from stereolag.ui.elements import show_refused

OFFERED = {
    "fast": "Convolution, fast",
    "accurate": "Semi-global, accurate",
    "bm": "StereoBM",
    "sgbm": "StereoSGBM",
}
FROM_DEPTH_PAGE = "as on the depth page"
AT_FIRST = ("fast", "bm")
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

    @property
    def titles(self) -> list[str]:
        """Return the titles of the pictures in the video, in order."""
        more = [*([TRUTH_TITLE] if self.truth_in_video else []), *([MOTION_TITLE] if self.motion else [])]
        return ["Left image", *map(title_of, self.matchers), *more]


def ask_methods(drive: Drive) -> DriveSettings:
    """Ask for the methods and for the range that they search."""
    own = {f"own_{one.short_name}": one for one in matchers_in_use()}
    titles = OFFERED | {name: f"{one.title}, {FROM_DEPTH_PAGE}" for name, one in own.items()}
    with st.container(horizontal=True, vertical_alignment="bottom", gap="medium"):
        chosen = st.pills(
            "Methods",
            [*titles],
            selection_mode="multi",
            default=AT_FIRST,
            format_func=titles.__getitem__,
            **persistent(f"{KEY}.methods"),
            wrap=True,
        )
        first, count = _ask_range(drive)
    made: dict[str, StereoMatcher] = {
        "fast": preset("fast"),
        "accurate": preset("accurate"),
        "bm": StereoBM(),
        "sgbm": StereoSGBM(),
        **own,
    }
    _warn_of_range(drive)
    found = {}
    for name in chosen:
        try:
            found[name] = made[name].with_search_range(first, count)
        except SettingsError as error:
            show_refused(f"{titles[name]}: {error}")
    with st.container(horizontal=True, vertical_alignment="bottom", gap="medium"):
        motion = _ask_motion(drive)
        truth = drive.sequence.has_truth and st.toggle(TRUTH_TITLE, **persistent(f"{KEY}.truth"))
        return DriveSettings(found, truth, motion, _ask_steadiness())


def _ask_range(drive: Drive) -> tuple[int, int]:
    """Ask for the first disparity and the number of disparities, within the limits of the map files."""
    lowest, needed = drive.range or (0, USUAL_DISPARITIES)
    first = st.number_input(
        "Smallest disparity, px",
        0,
        MOST - FEWEST,
        min(max(0, lowest), MOST - FEWEST),
        **persistent(f"{KEY}.first.{drive.digest}"),
        width=170,
    )
    # OpenCV's methods search whole blocks of 16, which must fit too.
    most = (MOST - first) // FEWEST * FEWEST
    key = f"{KEY}.count.{drive.digest}"
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
        width=170,
    )
    return first, count


def _warn_of_range(drive: Drive) -> None:
    """Warn if the frames need disparities that the map files cannot store."""
    if drive.range is None:
        return
    lowest, end = drive.range[0], sum(drive.range)
    if lowest < 0:
        prose.warning(
            f"In these frames disparities reach down to about {lowest} px; the maps of a drive begin at 0 px. "
            "Rectify the frames so that infinity has disparity 0, or take single frames to the depth page."
        )
    if end > MOST:
        prose.warning(
            f"In these frames disparities reach up to about {end} px; the maps of a drive end at {MOST} px. Give "
            "frames of half the size, or take single frames to the depth page."
        )


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
    if drive.calibration is None:
        prose.caption("Speeds and moving objects need metres: give a calibration above.", width="content")
    else:
        rate = st.number_input(
            "Frames a second",
            0.1,
            10_000.0,
            float(rate),
            **persistent(f"{KEY}.rate.{drive.digest}"),
            width=170,
            help="Of the camera. Speeds are only as accurate as this number; image files lack it, and 10 is assumed.",
        )
    return SequenceMotion(arrows=shown == ARROWS, frame_rate=rate)


def _ask_steadiness() -> Steadiness | None:
    """Ask whether the previous frame takes part in each map."""
    field = SequenceSettings.model_fields["steadiness"]
    wanted = st.toggle(str(field.title), help=field.description, **persistent(f"{KEY}.steadiness"))
    return Steadiness() if wanted else None


def title_of(name: str) -> str:
    """Return the title of a method, shown above its maps."""
    by_name = {method.short_name: method.title for method in METHODS}
    return OFFERED.get(name) or by_name[name.removeprefix("own_")]
