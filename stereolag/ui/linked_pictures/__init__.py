"""Pictures of one scene with one crosshair across all: zoomed together, read under the cursor, clicked on.

All that follows the pointer happens in the browser (the scripts beside this file); only a click comes back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType

import streamlit as st

from stereolag.figures.legends import Legend
from stereolag.figures.linked_pictures import Colours, PackedPicture, Picture, described, packed

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


def source(*names: str, folder: Path = HERE) -> str:
    """Return the texts of files of a component, one behind the other."""
    return "\n".join((folder / name).read_text(encoding="utf-8") for name in names)


_viewer = st.components.v2.component(
    "stereolag.linked_pictures",
    html=source("pictures.html"),
    css=source("pictures.css", "legends.css"),
    js=source(
        "fflate.js",
        "unpacking.js",
        "legends.js",
        "numbers.js",
        "drawing.js",
        "outlining.js",
        "pictures.js",
        "shown.js",
        "gestures.js",
    ),
)
# Each picture travels alone, and so do the marks: Streamlit finds those that did not change, and does not send them.
_picture = st.components.v2.component("stereolag.picture", js=source("picture.js"))
_marks = st.components.v2.component("stereolag.marks", js=source("marks.js"))
_outlines = st.components.v2.component("stereolag.outlines", js=source("outlines.js"))


NOTHING_SENT: Mapping[str, PackedPicture] = MappingProxyType({})


def send_picture(pack: PackedPicture, title: str, *, key: str) -> None:
    """Send the pixels and readings of one of the pictures of :func:`linked_pictures`, ahead of all that is said of it.

    In the browser it takes the place of the picture of this title that is shown.
    """
    _picture(key=f"{key}.picture.{title}", data=pack.data)


def linked_pictures(
    pictures: Sequence[Picture],
    *,
    key: str,
    colours: Colours | None = None,
    legends: Sequence[Legend] = (),
    columns: int = 3,
    hint: str = "",
    marks: Sequence[Mark] = (),
    on_pick: Callable[[int, int], None] | None = None,
    pack: Callable[[Picture], PackedPicture] = packed,
    sent: Mapping[str, PackedPicture] = NOTHING_SENT,
) -> None:
    """Show pictures of one size.

    Parameters
    ----------
    pictures, legends
        What is shown, and what its colours mean.
    key
        Of the component.
    colours
        Of the pictures that have no pixels of their own, and the outlines over these.
    columns
        How many stand side by side where there is room.
    hint
        A sentence below them, before the one that says how to move about.
    marks
        What is drawn over the pictures; the readings stand at the last point while no pointer is over them.
    on_pick
        Called with the row and column of the pixel that was clicked, before the fragment runs again; without it a
        click does nothing.
    pack
        Packs a picture, for whoever remembers those that were packed before.
    sent
        Pictures that :func:`send_picture` sent already in this run, by their titles.
    """

    def picked() -> None:
        pixel = st.session_state[key].picked
        if on_pick and pixel is not None:
            on_pick(int(pixel["row"]), int(pixel["col"]))

    if on_pick is None:
        pictures = [replace(picture, pickable=False) for picture in pictures]
    packs = []
    with st.container(gap=None):
        for picture in pictures:
            packs.append(sent.get(picture.title) or pack(picture))
            if picture.title not in sent:
                send_picture(packs[-1], picture.title, key=key)
        header = described(pictures, packs, name=key, colours=colours, legends=legends, columns=columns, hint=hint)
        _viewer(key=key, data=header, on_picked_change=picked)
        _marks(key=f"{key}.marks", data={"name": key, "marks": [asdict(mark) for mark in marks]})
        if colours and colours.outlines:
            _outlines(key=f"{key}.outlines", data={"name": key, "path": colours.outlines})
