"""The search page's sentences and pictures about an answer."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.figures.templates import framed
from stereolag.templates import TemplateMatch, TemplateSearch, match_template
from stereolag.templates.verdict import Reason
from stereolag.ui.search.sentences import doubtful

PAGE = "pages/2_Rocketman_search.py"


def answer(*scores: float, reason: Reason, clear: int = 0) -> TemplateSearch:
    places = [TemplateMatch(0, 50 * index, 10, 10, score) for index, score in enumerate(scores)]
    best = places[0] if places else None
    return TemplateSearch(places[: max(clear, 1)], None, 9, 0.1, best, places[max(clear, 1) :], clear, reason)


def test_what_is_doubtful_is_framed_in_dashes() -> None:
    assert doubtful(answer(0.9, 0.3, reason="clear", clear=1)) == []
    assert len(doubtful(answer(0.62, 0.6, 0.1, reason="look_alikes"))) == 2
    assert [one.score for one in doubtful(answer(0.3, 0.2, reason="low_score"))] == [0.3]
    picture = np.zeros((200, 300, 3), np.uint8)
    match = TemplateMatch(50, 80, 60, 90, 0.3)
    solid, dashed, none = framed(picture, [match]), framed(picture, [], [match]), framed(picture, [])
    assert len({solid, dashed, none}) == 3


def test_a_frame_is_turned_as_the_template_is() -> None:
    match = TemplateMatch(60, 80, 90, 90, 0.9, 1.0, 30.0)
    shown = cv2.imdecode(
        np.frombuffer(framed(np.zeros((200, 300, 3), np.uint8), [match], template=(40, 80)), np.uint8), 1
    )
    rows, cols = np.nonzero(shown.any(axis=2))
    (_, (one, other), _) = cv2.minAreaRect(np.column_stack([cols, rows]).astype(np.float32))
    assert sorted((one, other)) == pytest.approx([40, 80], abs=10)
    top = int(cols[rows == rows.min()].mean())
    assert top > 125  # rotation is counter-clockwise: the upper right corner is the highest


def framed_picture(app: AppTest) -> str:
    pictures = [picture for element in app.get("image") for picture in element.proto.imgs]
    (whole,) = [picture.url for picture in pictures if picture.alt.startswith("The image: ")]
    return whole


@pytest.mark.usefixtures("small_mazes")
def test_the_page_frames_a_look_alike_beside_the_template(open_page: Callable[..., AppTest]) -> None:
    app = open_page(PAGE, {"pictures": "maze_dulled"})
    assert app.header[0].value == "Found at row 200, column 200"
    found = framed_picture(app)
    app.slider(key="template.min_score").set_value(0.95).run()
    assert app.header[0].value == "Not found"
    assert framed_picture(app) != found  # the frame is dashed
    captions = [picture.caption for element in app.get("image") for picture in element.proto.imgs]
    assert "the template" in captions
    assert any(caption.startswith("row 200, column 200, score 0.7") for caption in captions)


@pytest.mark.usefixtures("small_mazes")
def test_the_page_finds_him_among_other_sizes_and_angles(open_page: Callable[..., AppTest]) -> None:
    app = open_page(PAGE)
    app.slider(key="template.max_rotation").set_value(10.0).run()
    assert not app.exception
    assert app.header[0].value == "Found at row 200, column 200"
    assert any("no score map" in caption.value for caption in app.caption)
    app.button_group(key="template.method").set_value("sampled").run()
    assert not app.exception
    assert app.header[0].value == "Found at row 200, column 200"
    assert app.slider(key="template.max_rotation").disabled


def test_the_search_is_refused_the_same_way_by_page_and_library() -> None:
    with pytest.raises(ValueError, match="searched by 'fft' alone"):
        match_template(np.eye(9), np.eye(3), method="direct", rotations=(0, 5))
