"""The page Rocketman search with a camera: a box cut from its picture is followed, and a frame can be frozen."""

from __future__ import annotations

import math
from dataclasses import asdict
from functools import partial
from typing import Any, Final

import streamlit as st

from stereolag.core.searches import TemplateQuery
from stereolag.figures.pictures import png
from stereolag.templates.following import LARGEST, SMALLEST, Followed, Follower
from stereolag.templates.poses import Pose
from stereolag.ui.components import component, packed_item
from stereolag.ui.controls import adopt_value
from stereolag.ui.inputs import PICTURES
from stereolag.ui.search.hand_marks import LEAST_SIDE, read_box
from stereolag.ui.search.sentences import FOLLOWING_WORDS, FROZEN, FROZEN_TEMPLATE, NO_BOX_YET
from stereolag.ui.streams import Message, Stream, Whole, connected, frame, open_stream
from stereolag.ui.uploads import OWN, forget_upload, hand_in_picture

KEY: Final = "template.following"

RESIZED, TURNED = 0.015, 2.0
"""Change of size and angle, degrees, from which a template is not found as it was cut."""

SIZES, ANGLES = 0.05, 5.0
"""Steps of the sizes and angles asked for."""

_following = component("following")


class Frame(Message):
    """A picture, its number, and the box to be followed from it on, if there is a new one."""

    parts: tuple[bytes]
    number: Whole
    box: dict[str, int] | None = None


def show_following(query: TemplateQuery) -> None:
    """Show the camera; the settings act on its next frame. Begin with the page's files once a frame was frozen."""
    if st.session_state.pop(f"{KEY}.frozen", False):
        st.rerun()
    stream = open_stream("search", Frame)
    stream.answer = partial(answer, stream.kept, query)
    _following(
        key=KEY,
        data={**connected(stream, {}), "told": FOLLOWING_WORDS, "least": LEAST_SIDE},
        on_frozen_change=partial(_freeze, stream),
    )


def answer(kept: dict[str, Any], query: TemplateQuery, message: Frame) -> bytes:
    """Return where the template is in a frame: that of the box drawn on this frame, or of the last one before."""
    picture = frame(message.parts[0])
    if message.box is not None:
        box = read_box(message.box, picture.shape)
        template = picture[box.slices].copy()
        kept["follower"] = Follower(template, box.row + box.height / 2, box.col + box.width / 2)
        kept["template"] = template
    if "follower" not in kept:
        raise ValueError(NO_BOX_YET)
    followed: Followed = kept["follower"].follow(picture, query)
    kept["place"], kept["picture"] = followed.place, message.parts[0]
    told = {
        "digest": "followed",
        "number": message.number,
        "shape": kept["template"].shape[:2],
        "state": followed.state,
        "score": followed.score,
        "place": None if followed.place is None else asdict(followed.place),
    }
    return packed_item(told).data


def _freeze(stream: Stream) -> None:
    """Make the last frame and the template the files of the page, to be searched at the size and angle it has there."""
    kept = stream.kept
    if "picture" not in kept:
        return
    hand_in_picture(kept["picture"], FROZEN, key=f"{PICTURES}.picture")
    hand_in_picture(png(kept["template"]), FROZEN_TEMPLATE, key=f"{PICTURES}.template")
    forget_upload(f"{PICTURES}.mask")
    place: Pose | None = kept["place"]
    if place is not None and abs(place.scale - 1) > RESIZED:
        low, high = math.floor(place.scale / SIZES) * SIZES, math.ceil(place.scale / SIZES) * SIZES
        adopt_value("template.min_scale", round(max(SMALLEST, min(1.0, low)), 2))
        adopt_value("template.max_scale", round(min(LARGEST, max(1.0, high)), 2))
    if place is not None and abs(place.rotation) > TURNED:
        adopt_value("template.max_rotation", min(180.0, math.ceil(abs(place.rotation) / ANGLES) * ANGLES))
    st.session_state.update({PICTURES: OWN, f"{PICTURES}.from": "given", f"{KEY}.frozen": True})
