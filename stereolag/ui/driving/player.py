"""A browser player for a sequence and its maps, which works while they are still being computed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

import streamlit as st

from stereolag.figures.legends import Legend
from stereolag.sequences.records import FrameRecord
from stereolag.ui.components import component, deliver
from stereolag.ui.packing import packed_item

_player = component("player")


class Chart(NamedTuple):
    """One chart of the timeline: a figure plotted over the frames."""

    name: str
    field: str
    unit: str
    digits: int
    scale: float = 1.0
    from_zero: bool = True


CHARTS = (
    Chart("Coverage", "coverage", "%", 0, 100.0, from_zero=False),
    Chart("Took", "milliseconds", "ms", 0),
    Chart("Nearest obstacle", "nearest_m", "m", 1),
    Chart("Nearest obstacle", "nearest_px", "px", 1),
    Chart("Wrong by over 2 px", "bad_2_percent", "%", 1),
    Chart("Flicker", "flicker_px", "px", 2),
    Chart("Own speed", "own_speed_kmh", "km/h", 0),
)


class Line(NamedTuple):
    """The line style of one method; the dashes (px, of an SVG) are for colour-blind viewers."""

    colour: str
    dash: str


LINES = (Line("#785bd5", ""), Line("#d87607", "8 4"), Line("#0ca674", "2 3"), Line("#bd195c", "8 3 2 3"))


class VideoInfo(NamedTuple):
    """The video to play.

    Attributes
    ----------
    name
        Identifies the video.
    titles
        Titles of its pictures, which are side by side.
    methods
        {name in the records: title}, in order.
    size
        Rows and columns of one picture.
    frame_rate
        Frame rate, Hz.
    names
        Names of all frames.
    """

    name: str
    titles: Sequence[str]
    methods: dict[str, str]
    size: tuple[int, int]
    frame_rate: float
    names: Sequence[str]


def show_player(
    video: VideoInfo,
    pieces: Sequence[bytes],
    records: Sequence[FrameRecord],
    *,
    computed: int,
    done: bool,
    legends: Sequence[Legend],
    key: str,
    on_open: Callable[[int], None],
) -> None:
    """Show the player.

    Parameters
    ----------
    video
        The video to play.
    pieces
        Pieces of the video so far.
    records
        Figures of the frames so far.
    computed
        Number of frames in the pieces.
    done
        Whether no more pieces will come.
    legends
        Legends of the map colours.
    key
        Key of the component.
    on_open
        Called with the number of the frame that the visitor wants to see on the depth page.
    """

    def opened() -> None:
        frame = st.session_state[key].opened
        if frame is not None:
            on_open(int(frame))

    data = described(video, records) | {"pieces": len(pieces), "computed": computed, "done": done}
    data["legends"] = [asdict(legend) for legend in legends]
    with st.container(gap=None):
        for number, piece in enumerate(pieces):
            name = f"{video.name} {number}"
            item = packed_item({"kind": "video", "name": name, "digest": name}, [piece])
            deliver(item.data, key=f"{key}.piece.{number}")
        _player(key=key, data=data, on_opened_change=opened)


def described(video: VideoInfo, records: Sequence[FrameRecord]) -> dict[str, Any]:
    """Return the data the browser needs besides the video: the figures of every frame, None if unknown."""
    count = len(video.names)
    problems: list[str] = [""] * count
    for record in records:
        problems[record.number] = record.problem or problems[record.number]
    charts = []
    for chart in CHARTS:
        values: dict[str, list[float | None]] = {method: [None] * count for method in video.methods}
        for record in records:
            value = getattr(record, chart.field) * chart.scale
            if math.isfinite(value):
                values[record.method][record.number] = round(value, 3)
        if any(one is not None for column in values.values() for one in column):
            # Each method keeps its place, and so its colour, even if others have no values.
            series = [
                {"title": title, "values": values[method], **LINES[place % len(LINES)]._asdict()}
                for place, (method, title) in enumerate(video.methods.items())
                if any(one is not None for one in values[method])
            ]
            charts.append(
                {
                    "name": chart.name,
                    "unit": chart.unit,
                    "digits": chart.digits,
                    "from_zero": chart.from_zero,
                    "series": series,
                }
            )
    named = [chart["name"] for chart in charts]
    # In metres if known, otherwise in pixels.
    if named.count("Nearest obstacle") > 1:
        charts = [chart for chart in charts if (chart["name"], chart["unit"]) != ("Nearest obstacle", "px")]
    return {
        "name": video.name,
        "titles": [*video.titles],
        "height": video.size[0],
        "width": video.size[1],
        "rate": video.frame_rate,
        "frames": count,
        "names": [*video.names],
        "problems": problems,
        "charts": charts,
    }
