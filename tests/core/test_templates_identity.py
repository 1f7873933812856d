"""What a place shows beside the template: it, in another light or contrast, covered, a sibling, or something else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image, ImageDraw, ImageFont

from stereolag import TemplateSearch, match_template

Array = npt.NDArray[Any]
FINER = 8
SIDE = 32
BLUE, GROUND = (0, 95, 184), (243, 243, 243)
MARKS = ("plus", "minus", "cross", "bars", "dot")


def icon(
    mark: str,
    colour: tuple[int, int, int] = BLUE,
    *,
    shift: tuple[float, float] = (0, 0),
    rounded: bool = True,
    side: int = SIDE,
) -> Array:
    """Return a mark in an outline on a plain ground, (side, side, 3), drawn finer and averaged."""
    fine = np.full((SIDE * FINER, SIDE * FINER, 3), GROUND, np.uint8)

    def at(x: float, y: float) -> tuple[int, int]:
        return round((x + shift[1]) * FINER), round((y + shift[0]) * FINER)

    if rounded:
        cv2.circle(fine, at(16, 16), 11 * FINER, colour, 2 * FINER)
    lines = {
        "plus": [((11, 16), (21, 16)), ((16, 11), (16, 21))],
        "minus": [((11, 16), (21, 16))],
        "cross": [((12, 12), (20, 20)), ((12, 20), (20, 12))],
        "bars": [((12, y), (20, y)) for y in (12, 16, 20)],
        "arrow": [((10, 16), (22, 16)), ((10, 16), (15, 11)), ((10, 16), (15, 21))],
        "dot": [((16, 16), (16, 16.1))],
    }[mark]
    for start, end in lines:
        cv2.line(fine, at(*start), at(*end), colour, (4 if mark == "dot" else 2) * FINER)
    return np.asarray(cv2.resize(fine, (side, side), interpolation=cv2.INTER_AREA))


def screen(*icons: Array, seed: int = 0) -> Array:
    """Return a plain screen with lines of blots for text, and the icons in a row, 60 px apart from (40, 20) on."""
    random = np.random.default_rng(seed)
    picture = np.full((160, 420, 3), GROUND, np.uint8)
    for row in (100, 120, 140):
        for col in range(10, 400, 9):
            picture[row : row + int(random.integers(3, 9)), col : col + int(random.integers(2, 7))] = 40
    for number, one in enumerate(icons):
        picture[40 : 40 + SIDE, 20 + 60 * number : 20 + 60 * number + SIDE] = one
    return picture


def photograph(seed: int, rows: int = 220, cols: int = 300) -> Array:
    """Return colours that vary smoothly with some edges."""
    random = np.random.default_rng(seed)
    picture = cv2.GaussianBlur(random.normal(size=(rows, cols, 3)).astype(np.float32), (0, 0), 4) * 400 + 120
    for _ in range(30):
        row, col = int(random.integers(0, rows - 20)), int(random.integers(0, cols - 20))
        height, width = random.integers(8, 50, 2)
        picture[row : row + height, col : col + width] += random.normal(0, 40, 3)
    return np.asarray(np.clip(picture, 0, 255), dtype=np.uint8)


def place(search: TemplateSearch) -> tuple[int, int]:
    assert search.best is not None
    return search.best.row, search.best.col


def disagreeing(search: TemplateSearch) -> int:
    assert search.best is not None
    return sum(not agrees for line in search.best.blocks for agrees in line)


@pytest.mark.parametrize("mark", MARKS)
def test_a_sibling_alone_is_not_found_and_the_blocks_that_differ_are_told(mark: str) -> None:
    for other in MARKS[MARKS.index(mark) :]:
        search = match_template(screen(icon(mark)), icon(other))
        if other == mark:
            assert (search.reason, place(search), disagreeing(search)) == ("clear", (40, 20), 0)
        else:
            assert (search.found, search.reason, place(search)) == (False, "differs", (40, 20)), other
            assert 0 < disagreeing(search) <= 12, "in the middle of 36 blocks"


@pytest.mark.parametrize("shift", [(0, 0.5), (0.5, 0), (0.5, 0.5), (-0.3, 0.4)])
@pytest.mark.parametrize("mark", MARKS)
def test_an_icon_that_is_its_own_mirror_image_is_found_off_the_grid(mark: str, shift: tuple[float, float]) -> None:
    search = match_template(screen(icon(mark, shift=shift), icon("arrow")), icon(mark))
    assert (search.reason, search.clear) == ("clear", 1)
    assert np.abs(np.subtract(place(search), (40, 20))).max() <= 1


@pytest.mark.parametrize(("mark", "shift", "sibling"), [("dot", (0.75, 0.5), "minus"), ("bars", (0.5, 0.75), "minus")])
def test_a_mark_that_is_drawn_a_little_off_in_its_frame_is_found_and_its_sibling_is_not(
    mark: str, shift: tuple[float, float], sibling: str
) -> None:
    def framed(mark: str, shift: tuple[float, float] = (0, 0)) -> Array:
        return np.asarray(cv2.rectangle(icon(mark, shift=shift, rounded=False), (3, 3), (28, 28), BLUE, 1))

    assert match_template(screen(framed(mark, shift), framed("cross")), framed(mark)).found
    assert not match_template(screen(framed(sibling, shift), framed("cross")), framed(mark)).found


def test_a_mirror_image_is_told_as_such() -> None:
    search = match_template(screen(icon("arrow")[:, ::-1]), icon("arrow"))
    assert (search.found, search.reason) == (False, "mirrored")


@pytest.mark.parametrize("contrast", [0.35, 0.6])
def test_a_paler_form_is_told_by_its_contrast_and_comes_after_an_exact_copy(contrast: float) -> None:
    template = icon("cross")
    pale = (np.array(GROUND) + contrast * (template.astype(float) - GROUND)).round().astype(np.uint8)
    alone = match_template(screen(pale), template)
    assert (alone.found, alone.reason, place(alone)) == (True, "lower_contrast", (40, 20))
    assert alone.matches[0].contrast == pytest.approx(contrast, rel=0.05)
    assert alone.matches[0].gain == pytest.approx([contrast] * 3, rel=0.05)
    both = match_template(screen(pale, template), template, max_matches=5)
    assert (both.reason, both.clear, place(both)) == ("clear", 1, (40, 80))
    assert (both.matches[1].col, both.matches[1].kind) == (20, "lower_contrast")
    darker = match_template(screen(template), pale)
    assert (darker.found, darker.reason) == (True, "higher_contrast")


@pytest.mark.parametrize("colour", [(210, 210, 30), (130, 130, 130), (255, 140, 0), (200, 40, 40)])
def test_another_colour_is_not_found_though_its_shape_is_there(colour: tuple[int, int, int]) -> None:
    search = match_template(screen(icon("dot", colour, rounded=False)), icon("dot", (30, 170, 40), rounded=False))
    assert (search.found, search.reason, place(search)) == (False, "other_colours", (40, 20))


@pytest.mark.parametrize("ground", [(205, 205, 205), (235, 140, 20)])
def test_a_button_of_another_colour_is_not_found(ground: tuple[int, int, int]) -> None:
    blank = np.asarray(icon("bars", (255, 255, 255)) != GROUND).any(axis=2, keepdims=True)
    here, template = (
        np.where(blank, 255, np.array(colour, np.uint8)).astype(np.uint8)[2:30] for colour in (ground, (200, 40, 40))
    )
    picture = screen()
    picture[40:68, 20:52] = here
    search = match_template(picture, template)
    assert (search.found, search.reason, place(search)) == (False, "other_colours", (40, 20))
    picture[40:68, 80:112] = template
    assert place(both := match_template(picture, template)) == (40, 80) and both.found


@pytest.mark.parametrize("seed", range(4))
def test_another_white_balance_is_not_another_colour(seed: int) -> None:
    light = np.random.default_rng(seed).uniform(0.75, 1.2, 3)
    for picture, template in (
        (screen(icon("dot", (30, 170, 40)), icon("bars", (200, 40, 40))), icon("dot", (30, 170, 40))),
        (photograph(seed), photograph(seed)[40 : 40 + 50, 20 : 20 + 60]),
    ):
        search = match_template(np.clip(picture * light, 0, 255).astype(np.uint8), template)
        assert (search.found, place(search)) == (True, (40, 20)), search.reason


@pytest.mark.parametrize("seed", range(4))
def test_jpeg_and_gamma_leave_it_the_template_and_a_small_difference_does_not(seed: int) -> None:
    red, green = icon("dot", (200, 40, 40)), icon("dot", (30, 170, 40))
    _, data = cv2.imencode(".jpg", screen(red, green, seed=seed), [cv2.IMWRITE_JPEG_QUALITY, 40 + 10 * seed])
    jpeg = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))
    taken = photograph(seed)
    bent = np.rint(255 * (taken / 255) ** (0.55, 0.7, 1.5, 1.8)[seed]).astype(np.uint8)
    for picture, template in ((jpeg, red), (bent, taken[40:90, 20:80].copy())):
        search = match_template(picture, template)
        assert (search.found, place(search)) == (True, (40, 20)), search.reason
    marked = icon("bars")
    marked[(7, 22)[seed // 2] :, 14:18][:4] = BLUE if seed % 2 else (120, 160, 210)
    search = match_template(screen(marked, seed=seed), icon("bars"))
    assert (search.found, search.reason) == (False, "differs")


@pytest.mark.parametrize("seed", range(4))
def test_where_no_second_place_fits_only_the_place_itself_counts(seed: int) -> None:
    def landscape(seed: int, rows: int, cols: int) -> Array:
        random = np.random.default_rng(seed)
        picture = random.normal(0, 6, (rows, cols, 3)) + np.array([150, 180, 210])
        picture[rows // 2 :] -= np.array([115, 120, 180])
        for _ in range(4):
            col, tall = int(random.integers(0, cols - 30)), int(random.integers(10, rows // 3))
            picture[rows // 2 - tall : rows // 2, col : col + 25] = random.integers(30, 230, 3)
        return np.asarray(np.clip(picture, 0, 255), dtype=np.uint8)

    other, own = landscape(seed, 120, 150), landscape(seed + 50, 150, 200)
    absent = match_template(own, other)
    assert (absent.found, absent.rivals) == (False, [])
    assert absent.best is not None and absent.best.score > 0.6
    assert match_template(own, own[20:140, 30:180]).reason == "clear"


def test_buttons_alike_but_for_their_words_hide_no_buttons_that_are_missing() -> None:
    def buttons(*words: str) -> Array:
        drawn = np.full((82, 161, 3), (227, 226, 231), np.uint8)
        for number, word in enumerate(words):
            row, col, width = 2 + 40 * (number // 2), 89 * (number % 2), 72 + 3 * (1 - number % 2)
            fill, ink = ((47, 58, 102), (250,) * 3) if not number else ((255,) * 3, (40,) * 3)
            drawn[row : row + 28, col : col + width] = fill
            cv2.putText(drawn, word, (col + 4, row + 19), cv2.FONT_HERSHEY_SIMPLEX, 0.5, ink, 1, cv2.LINE_AA)
        return drawn

    picture = np.full((300, 400, 3), (227, 226, 231), np.uint8)
    picture[100:182, 60:221] = buttons("Cancel", "Archiv")
    search = match_template(picture, buttons("Tempo", "Monda", "Volume", "Figure"))
    assert not search.found, search.best


def sky(seed: int, rows: int = 110, cols: int = 190) -> Array:
    random = np.random.default_rng(seed)
    shown = np.abs(random.normal(14, 7, (rows, cols, 3)))
    for _ in range(28):
        col, row, radius = (int(one) for one in random.integers((0, 0, 1), (cols, rows, 4)))
        cv2.circle(shown, (col, row), radius, random.uniform(120, 255, 3).tolist(), -1)
    for _ in range(4):
        row, col, spread = random.uniform((0, 0, 6), (rows, cols, 14))
        away = np.hypot(np.arange(rows)[:, np.newaxis] - row, np.arange(cols) - col)
        shown += np.exp(-((away / spread) ** 2))[:, :, np.newaxis] * [230, 150, 100]
    return np.asarray(np.clip(cv2.GaussianBlur(shown, (0, 0), 0.7), 0, 255), dtype=np.uint8)


@pytest.mark.parametrize("seed", [5, 8])
def test_another_sky_in_the_same_frame_is_not_partly_covered(seed: int) -> None:
    def page(seed: int) -> Array:
        framed = np.full((200, 300, 3), 244, np.uint8)
        framed[50:160, 60:250] = sky(seed)
        return framed

    template = page(seed + 100)[30:170, 130:270]
    assert not match_template(page(seed), template).found
    assert match_template(page(seed + 100), template).found


@pytest.mark.parametrize("drawn", ["cross", "bars"])
def test_a_sibling_in_a_screen_reduced_and_compressed_is_another(drawn: str) -> None:
    def reduced(mark: str) -> Array:
        picture = screen()
        picture[40:64, 80:104] = icon(mark, side=24)
        small = np.asarray(cv2.resize(picture, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA))
        _, data = cv2.imencode(".jpg", small[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 75])
        return np.ascontiguousarray(cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :, ::-1])

    assert not match_template(reduced(drawn), icon("plus", side=24), scales=(0.45, 1.1)).found
    assert match_template(reduced("plus"), icon("plus", side=24), scales=(0.45, 1.1)).found


@pytest.mark.parametrize(("word", "noise"), [("Replace", 6), ("Undo", 10)])
def test_noise_in_flat_blocks_does_not_hide_another_digit(word: str, noise: float) -> None:
    def rows(time: str, noise: float) -> Array:
        drawn = Image.new("RGB", (240, 100), (255, 255, 255))
        for row, texts in ((10, ("Archive", "09:10")), (42, (word, time)), (74, ("Search", "21:30"))):
            for col, text in zip((12, 160), texts, strict=True):
                ImageDraw.Draw(drawn).text((col, row), text, fill=(40, 40, 40), font=ImageFont.load_default(14))
        values = np.asarray(drawn) + np.random.default_rng(0).normal(0, noise, (100, 240, 3))
        return np.asarray(np.clip(np.rint(values), 0, 255), dtype=np.uint8)

    template = rows("12:45", 0)[36:64, 4:236]
    assert not match_template(rows("12:46", noise), template).found
    assert match_template(rows("12:45", noise), template).found


@pytest.mark.parametrize("wanted", [5, 6, 20, 1000])
def test_copies_are_counted_without_their_sibling_however_many_are_wanted(wanted: int) -> None:
    template = icon("minus")
    image = screen(*[template] * 5, icon("plus"))
    search = match_template(image, template, max_matches=wanted)
    assert (search.clear, search.reason) == (5, "clear")
    assert (search.rivals[0].col, search.rivals[0].kind) == (320, "differs")
    assert not match_template(image, template, max_matches=4).found


def test_seventy_copies_are_seventy() -> None:
    template = icon("cross")
    image = np.full((7 * 34, 11 * 34, 3), GROUND, np.uint8)
    places = [(34 * row, 34 * col) for row in range(7) for col in range(11)]
    for number, (row, col) in enumerate(places):
        image[row : row + SIDE, col : col + SIDE] = template if number < 70 else icon("bars")
    search = match_template(image, template, max_matches=100)
    assert sorted((one.row, one.col) for one in search.matches[: search.clear]) == places[:70]


def test_what_something_in_front_hides_is_told() -> None:
    middle = np.s_[95:120, 120:155]
    sides = np.s_[80:95, 100:180], np.s_[125:140, 100:180], np.s_[80:140, 100:120], np.s_[80:140, 160:180], middle
    for seed in range(2):
        for side, hidden in enumerate(sides):
            picture = photograph(seed)
            template = picture[80:140, 100:180].copy()
            picture[hidden] = photograph(seed + 20)[hidden] if side % 2 else (250, 250, 0)
            search = match_template(picture, template)
            assert (search.found, search.reason) == (True, "partly_covered"), (seed, side)
            assert np.abs(np.subtract(place(search), (80, 100))).max() <= 1
            assert 0 < disagreeing(search) < 25


@pytest.mark.parametrize(
    ("inside", "corner"),
    [
        (np.s_[78:], (-18, 100)),
        (np.s_[:102], (60, 100)),
        (np.s_[:, 121:], (60, -21)),
        (np.s_[:, :149], (60, 100)),
        (np.s_[66:, :163], (-6, 100)),
    ],
)
def test_a_template_cut_off_by_any_border_is_found_where_it_would_be(inside: Any, corner: tuple[int, int]) -> None:
    picture = photograph(3)
    template = picture[60:120, 100:170].copy()
    search = match_template(picture[inside], template)
    assert (search.found, search.reason, place(search)) == (True, "partly_covered", corner)
    assert search.score_map is not None and search.score_map.shape == tuple(
        length - side + 1 for length, side in zip(picture[inside].shape, template.shape[:2], strict=False)
    )


CHANGES: dict[str, Callable[[Array], Array]] = {
    "16 bits": lambda picture: picture.astype(np.uint16) * 200 + 300,
    "floats": lambda picture: picture.astype(np.float32) / 255 - 3,
    "signed": lambda picture: picture.astype(np.int16) * 50 - 9000,
    "twice as large": lambda picture: np.asarray(cv2.resize(picture, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC)),
    "a third smaller": lambda picture: np.asarray(
        cv2.resize(picture, None, fx=0.75, fy=0.75, interpolation=cv2.INTER_AREA)
    ),
    "grey": lambda picture: np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)),
    "in the corner": lambda picture: picture[40:, 20:] if picture.shape[0] > SIDE else picture,
    "alone": lambda picture: picture[36:76, 16:56] if picture.shape[0] > SIDE else picture,
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(
    ("shown", "sought", "reason"),
    [
        (icon("plus"), icon("plus"), "clear"),
        (icon("minus"), icon("plus"), "differs"),
        (icon("arrow")[:, ::-1], icon("arrow"), "mirrored"),
        (icon("bars") // 2 + 121, icon("bars"), "lower_contrast"),
        (icon("bars", (200, 40, 40)), icon("bars"), "other_colours"),
    ],
)
def test_a_verdict_holds_in_other_numbers_at_other_sizes_and_places(
    shown: Array, sought: Array, reason: str, change: str
) -> None:
    if reason == "other_colours" and change == "grey":
        return
    search = match_template(CHANGES[change](screen(shown)), CHANGES[change](sought))
    assert search.reason == reason, (search.best, search.rivals[:1])


def glyphs(seed: int, count: int = 60) -> list[Array]:
    """Return drawings of 9 × 9 px, each of a line and a triangle."""
    random = np.random.default_rng(seed)
    drawn = []
    for _ in range(count):
        fine = np.full((9 * FINER, 9 * FINER, 3), GROUND, np.uint8)
        cv2.fillPoly(fine, [random.integers(0, 9 * FINER, (3, 2)).astype(np.int32)], BLUE)
        ends = random.integers(0, 9 * FINER, (2, 2)).tolist()
        cv2.line(fine, ends[0], ends[1], (40, 40, 40), 2 * FINER)
        drawn.append(np.asarray(cv2.resize(fine, (9, 9), interpolation=cv2.INTER_AREA)))
    return drawn


@pytest.mark.parametrize("seed", [11, 37, 42, 44, 46, 47])
def test_a_few_blocks_of_a_few_pixels_that_agree_are_not_the_template(seed: int) -> None:
    template, *others = glyphs(seed)
    picture = np.full((100, 160, 3), GROUND, np.uint8)
    for number, other in enumerate(others):
        row, col = 8 + 15 * (number // 10), 5 + 15 * (number % 10)
        picture[row : row + 9, col : col + 9] = other
    assert not match_template(picture, template).found
    picture[8:17, 5:14] = template
    assert place(search := match_template(picture, template)) == (8, 5) and search.found


@pytest.mark.parametrize(("drawn", "sought", "side"), [("plus", "cross", 40), ("cross", "minus", 48)])
def test_a_resized_template_is_opaque_but_for_its_rim_so_a_sibling_at_another_size_differs(
    drawn: str, sought: str, side: int
) -> None:
    picture = screen()
    picture[30 : 30 + side, 50 : 50 + side] = icon(drawn, side=side)
    found = match_template(picture, icon(sought)[4:28, 4:28], scales=(0.9, 1.6))
    assert (found.found, found.reason) == (False, "differs")
    found = match_template(picture, icon(drawn)[4:28, 4:28], scales=(0.9, 1.6))
    assert found.found and found.matches[0].scale == pytest.approx(side / SIDE, rel=0.05)
