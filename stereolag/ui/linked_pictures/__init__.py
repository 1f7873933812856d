"""Pictures of one scene with one crosshair across all: zoomed together, read under the cursor, clicked on.

All that follows the pointer happens in the browser (the scripts beside this file); only a click comes back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import streamlit as st

from stereolag.figures.linked_pictures import Legend, Picture, packed

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Mark:
    """Something drawn over the pictures, px of the picture: a point, a frame, or a line to another point.

    Attributes
    ----------
    row, col
        The pixel of a point or of the start of a line, or the top-left pixel of a frame.
    colour
        As CSS writes it.
    label
        Written beside it.
    height, width
        The size of a frame.
    to
        (row, col) of the pixel where a line ends.
    dashed, filled
        Whether its line is dashed, and a frame tinted inside.
    pictures
        The numbers of the pictures it is drawn on; none means all.
    """

    row: int
    col: int
    colour: str
    label: str = ""
    height: int = 0
    width: int = 0
    to: tuple[int, int] | None = None
    dashed: bool = False
    filled: bool = False
    pictures: tuple[int, ...] = ()


def _source(*names: str) -> str:
    return "\n".join((HERE / name).read_text(encoding="utf-8") for name in names)


_pictures = st.components.v2.component(
    "stereolag.linked_pictures",
    html=_source("pictures.html"),
    css=_source("pictures.css"),
    js=_source("unpacking.js", "drawing.js", "pictures.js", "gestures.js"),
)
# The marks travel alone: a click then sends some bytes, and Streamlit finds the pictures unchanged and keeps them.
_marks = st.components.v2.component("stereolag.marks", js=_source("marks.js"))


def linked_pictures(
    pictures: Sequence[Picture],
    *,
    key: str,
    legends: Sequence[Legend] = (),
    columns: int = 3,
    hint: str = "",
    marks: Sequence[Mark] = (),
    on_pick: Callable[[int, int], None] | None = None,
) -> None:
    """Show pictures of one size.

    Parameters
    ----------
    pictures, legends
        What is shown, and what its colours mean.
    key
        Of the component.
    columns
        How many stand side by side where there is room.
    hint
        A sentence below them, before the one that says how to move about.
    marks
        What is drawn over the pictures; the readings stand at the last point while no pointer is over them.
    on_pick
        Called with the row and column of the pixel that was clicked, before the fragment runs again; without it a
        click does nothing.
    """

    def picked() -> None:
        pixel = st.session_state[key].picked
        if on_pick and pixel is not None:
            on_pick(int(pixel["row"]), int(pixel["col"]))

    if on_pick is None:
        pictures = [replace(picture, pickable=False) for picture in pictures]
    with st.container(gap=None):
        _pictures(
            key=key,
            data=packed(pictures, name=key, legends=legends, columns=columns, hint=hint),
            on_picked_change=picked,
        )
        _marks(key=f"{key}.marks", data={"name": key, "marks": [asdict(mark) for mark in marks]})
