"""Pictures of one scene with a common crosshair: zoomed together, read under the pointer, clickable.

Everything that follows the pointer happens in the browser; only a click comes back.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType

import streamlit as st

from stereolag.figures.legends import Colours, Legend
from stereolag.ui.components import component, deliver
from stereolag.ui.packing import PackedPicture, Picture, described, packed, packed_item

_viewer = component("linked_pictures")


@dataclass(frozen=True)
class Mark:
    """A mark drawn over the pictures, px of the picture: a point, a frame, or a line to another point.

    Attributes
    ----------
    row, col
        The pixel of a point or of the start of a line, or the top-left pixel of a frame.
    colour
        CSS colour.
    label
        Text beside it.
    height, width
        The size of a frame.
    to
        (row, col) of the pixel where a line ends.
    dashed, filled
        Whether its line is dashed, and whether a frame is tinted inside.
    pictures
        Indices of the pictures it is drawn on; empty means all.
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


NOTHING_SENT: Mapping[str, PackedPicture] = MappingProxyType({})


def send_picture(pack: PackedPicture, title: str, *, key: str) -> None:
    """Send the pixels and readings of one picture of :func:`linked_pictures`, ahead of everything else about it.

    In the browser it replaces the picture shown with this title.
    """
    deliver(pack.data, key=f"{key}.picture.{title}")


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
        The pictures, and the legends of their colours.
    key
        Key of the component.
    colours
        Colours of the pictures that have no pixels of their own, and the outlines over these.
    columns
        Number of pictures side by side, if there is room.
    hint
        Sentence below the pictures, before the one on zooming and moving.
    marks
        Marks drawn over the pictures; while no pointer is over them, the readings are those of the last point.
    on_pick
        Called with the row and column of the clicked pixel, before the fragment reruns; without it clicks do nothing.
    pack
        Packs a picture; callers may pass a function that remembers the pictures it packed.
    sent
        Pictures that :func:`send_picture` already sent in this run, by title.
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
        marked = {"kind": "marks", "name": key, "marks": [asdict(mark) for mark in marks]}
        deliver(packed_item(marked).data, key=f"{key}.marks")
        if colours and colours.outlines:
            outlined = {"kind": "outlines", "name": key, "path": colours.outlines}
            deliver(packed_item(outlined).data, key=f"{key}.outlines")
