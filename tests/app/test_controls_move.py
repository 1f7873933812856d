"""Moving any control of a page changes what is shown; controls of stereo methods: ``test_matcher_controls``."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from stereolag.io.images import read_image
from stereolag.samples import mazes
from stereolag.stereo.methods import METHODS
from tests.app import keys, uploads
from tests.app.pages import DEPTH, FIND, LAG, moved, open_page, open_unfolded, uploaded
from tests.app.reading import controls, shown

ONE_VISITOR = True


@dataclass(frozen=True)
class Moves:
    """Controls of one page and their new values, moved one at a time after the controls in `first` are set."""

    page: str
    first: dict[str, Any]
    values: dict[str, Any]

    def __str__(self) -> str:
        return " ".join([self.page, *(f"{name}={value}" for name, value in self.first.items())])


OWN = {"pictures": "own"}
"""A part of the maze, which is searched faster than all of it."""

MOVES = [
    Moves(
        LAG,
        {},
        {
            "recordings": "harbour",
            "lag.method": "phat",
            "lag.sampling_rate.recordings coast": 48_000.0,
            "lag.speed.recordings coast": 1_500.0,
            "lag.max_lag.recordings coast": 1_000,
            "lag.curve": "Not weighted",
        },
    ),
    Moves(LAG, {"lag.part": "Lined up"}, {"lag.from.recordings coast.50082": 1_000}),
    Moves(FIND, {}, {"pictures": "maze_dulled"}),
    Moves(FIND, OWN | {"template.max_matches": 5}, {"template.min_score": 0.95}),  # the second match scores lower
    Moves(
        FIND,
        OWN,
        {
            "pictures.from": "cut",
            "template.method": "sampled",
            "template.max_matches": 5,
            "template.min_scale": 0.99,
            "template.max_scale": 1.01,
            "template.max_rotation": 1.0,
            "degrade.contrast": 0.3,
            "degrade.brightness": 60,
            "degrade.noise": 20,
            "degrade.turn": 10.0,
            "degrade.resize": 0.8,
            "degrade.cover": 0.5,
        },
    ),
    # StereoBM's odd block is rounded on the way to half its size and back.
    Moves(DEPTH, {keys.SHOWN: ["correlation"]}, {"pairs.size": "1/2"}),
    Moves(
        DEPTH,
        {},
        {
            "pairs": "square",
            keys.PART: "Scoreboard",
            "depth.colours.range.pair cube.far": 10.0,
            "depth.colours.range.pair cube.near": 90.0,
            "depth.colours.inverted": True,
            "depth.colours.palette": "turbo",
            "depth.colours.outlined": True,
            keys.SHOWN: ["correlation", "sgbm"],
        },
    ),
]
SEEN_IN_THE_TIME_ALONE = {"lag.runs"}
ONLY_WITH_A_SQUARE_SEARCH = {keys.SEARCH_SIZE: 60}, {keys.REACH: 0}


@pytest.mark.parametrize("page", [LAG, FIND, DEPTH])
def test_every_control_of_the_page_is_tested_here(page: str) -> None:
    settings = tuple(f"depth.{method.short_name}." for method in METHODS)
    app = open_unfolded(page)
    found = {key for key in controls(app) if not key.startswith(settings)}
    if page == LAG:
        app.session_state["lag.part"] = "Lined up"
        found |= {*controls(app.run())}
    found -= SEEN_IN_THE_TIME_ALONE | {keys.TAB}
    moved = {key for moves in MOVES if moves.page == page for key in moves.values}
    unmoved, absent = sorted(found - moved), sorted(moved - found)
    assert not unmoved, f"MOVES does not say what these are moved to: {unmoved}"
    assert not absent, f"MOVES names what is not on the page: {absent}"


def test_the_box_beside_a_slider_takes_an_exact_value() -> None:
    app = open_page(DEPTH)

    def typed(key: str, value: int) -> int:
        """Type a value into the box beside a slider, and return that of the slider then."""
        app.number_input(key=keys.exact_key(key)).set_value(value).run()
        return int(app.slider(key=key).value)

    assert typed(keys.DISPARITIES, 300) == 300  # beyond the end of the slider
    assert app.number_input(key=keys.exact_key(keys.DISPARITIES)).value == 300
    assert typed(keys.DISPARITIES, 50) == 50
    assert typed(keys.SMALLEST, -100) == -100
    moved(app, {keys.TAB: "bm"})
    moved(app, {keys.TAB: "correlation"})
    assert app.slider(key=keys.SMALLEST).value == -100  # kept while it was folded away


def give_a_part_of_the_maze(app: AppTest) -> None:
    """Upload a part of the maze at half size with Rocketman in it twice, once dulled: the search is faster there."""
    maze = mazes()["maze"]
    rows, cols = (slice(start, start + 399, 2) for start in (maze.row - 128, maze.col - 132))
    template, picture = read_image(maze.template)[::2, ::2], read_image(maze.picture)[rows, cols].copy()
    height, width = template.shape[:2]
    dulled = np.random.default_rng(0).normal(0.85 * template[..., :3].astype(float), 25).clip(0, 255)
    picture[135 : 135 + height, 10 : 10 + width] = dulled
    uploaded(app, "pictures", **uploads.pngs(picture=picture, template=template))
    assert app.header[0].value.startswith("Found")


@pytest.mark.parametrize("moves", MOVES, ids=str)
def test_moving_a_control_changes_what_is_shown(moves: Moves) -> None:
    app = open_unfolded(moves.page)
    for name, value in moves.first.items():
        if name in controls(app):
            controls(app)[name].set_value(value)
        else:
            app.session_state[name] = value
    app.run()
    if moves.first.get("pictures") == "own":
        give_a_part_of_the_maze(app)
    before = shown(app)
    at_first = {key: controls(app)[key].value for key in moves.values}
    moved = ""
    for key, value in moves.values.items():
        if moved:  # it is reset in the run that moves the next one
            controls(app)[moved].set_value(at_first[moved])
        if key not in controls(app):
            app.run()
        controls(app)[key].set_value(value).run()
        assert not app.error, key
        assert shown(app) != before, key
        moved = key
    controls(app)[moved].set_value(at_first[moved]).run()
    assert not app.error
    assert shown(app) == before, (
        "what was moved before was not set back, so that any control seemed to change something"
    )


def test_the_square_search_has_its_own_controls_and_a_window_larger_than_it_is_refused() -> None:
    # Few windows make the search of a large square fast.
    app = moved(open_unfolded(DEPTH), {keys.WINDOW: 31, keys.OVERLAP: 0.0, keys.SEARCH: "centred"})
    for values in ONLY_WITH_A_SQUARE_SEARCH:
        before = shown(app)
        assert shown(moved(app, values)) != before
        assert not app.error
    before = shown(app)
    moved(app, {keys.WINDOW: 91})
    assert [error.value for error in app.error] == [
        typeset("search_size is 60 px and window_size 91 px; the search area must be at least as large as the window.")
    ]
    assert shown(app) == before
    assert app.slider(key=keys.WINDOW).value == 91
