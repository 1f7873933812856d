"""What a place shows beside the template: it, in another light, covered, drawn over, a sibling, or something else."""

from collections.abc import Callable
from itertools import product
from typing import Any

import cv2
import numpy as np
import pytest

from stereolag import TemplateMatch, TemplateSearch, match_template, read_image
from stereolag.core.arrays import Array
from stereolag.samples import stereo_pairs
from stereolag.templates.identity import Identity, identity
from stereolag.templates.patterns import pattern_of
from stereolag.templates.verdict import FOUND

FINER = 8
SIDE = 32
BLUE, GROUND = (0, 95, 184), (243, 243, 243)
MARKS = ("plus", "minus", "cross", "bars", "dot")


def icon(
    mark: str, colour: tuple[int, int, int] = BLUE, *, shift: tuple[float, float] = (0, 0), rounded: bool = True
) -> Array:
    """Return a mark in an outline on a plain ground, (SIDE, SIDE, 3), drawn finer and averaged."""
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
    return np.asarray(cv2.resize(fine, (SIDE, SIDE), interpolation=cv2.INTER_AREA))


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
    return search.best.row, search.best.col


def shown(picture: Array, template: Array, row: int, col: int) -> Identity:
    """Return what a place of the picture shows, without a search for it."""
    pattern = pattern_of(np.atleast_3d(template), np.ones(template.shape[:2]))
    return identity(np.atleast_3d(picture), pattern, row, col)


def disagreeing(place: TemplateMatch | Identity) -> int:
    return sum(not agrees for line in place.blocks for agrees in line)


@pytest.mark.parametrize("weights", ["ramp", "noise", "soft circle"])
def test_a_copy_under_a_mask_of_any_weights_is_the_same(weights):
    random = np.random.default_rng(0)
    image = random.integers(0, 256, (120, 160)).astype(np.float32)
    image = cv2.normalize(cv2.GaussianBlur(image, (0, 0), 2), None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    circle = cv2.circle(np.zeros((40, 60), np.uint8), (30, 20), 15, 255, -1)
    mask = {
        "ramp": np.tile(np.linspace(1, 255, 60).astype(np.uint8), (40, 1)),
        "noise": random.integers(0, 256, (40, 60), dtype=np.uint8),
        "soft circle": cv2.GaussianBlur(circle, (0, 0), 4),
    }[weights]
    assert match_template(image, image[30:70, 50:110], mask=mask).reason == "clear"


@pytest.mark.parametrize("mark", MARKS)
def test_a_sibling_alone_is_not_found_and_the_blocks_that_differ_are_told(mark: str) -> None:
    for other in MARKS[MARKS.index(mark) :]:
        found = shown(icon(mark), icon(other), 0, 0)
        assert found.kind == ("same" if other == mark else "differs"), other
        assert (disagreeing(found) == 0) == (other == mark) and disagreeing(found) <= 12, "in the middle of 36 blocks"


def test_a_small_sibling_in_a_reduced_screen_in_jpeg_is_not_found() -> None:
    reduced = {name: cv2.resize(screen(icon(name)), (210, 80), interpolation=cv2.INTER_AREA) for name in MARKS}
    kinds = [shown(in_jpeg(reduced[name]), reduced["cross"][20:36, 10:26], 20, 10).kind for name in ("cross", "plus")]
    assert kinds[0] == "same" and kinds[1] not in FOUND


@pytest.mark.parametrize(("mark", "shift", "sibling"), [("dot", (0.75, 0.5), "minus"), ("bars", (0.5, 0.75), "minus")])
def test_a_mark_that_is_drawn_a_little_off_in_its_frame_is_found_and_its_sibling_is_not(mark, shift, sibling):
    def framed(mark: str, shift: tuple[float, float] = (0, 0)) -> Array:
        return np.asarray(cv2.rectangle(icon(mark, shift=shift, rounded=False), (3, 3), (28, 28), BLUE, 1))

    assert match_template(screen(framed(mark, shift), framed("cross")), framed(mark)).found
    assert not match_template(screen(framed(sibling, shift), framed("cross")), framed(mark)).found


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


@pytest.mark.parametrize(("seed", "gamma"), [*enumerate((0.55, 0.7, 1.5, 1.8))])
def test_another_gamma_leaves_it_the_template(seed: int, gamma: float) -> None:
    taken = photograph(seed)
    bent = np.rint(255 * (taken / 255) ** gamma).astype(np.uint8)
    assert shown(bent, taken[40:90, 20:80], 40, 20).kind in FOUND


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


def test_the_steep_rim_of_a_bright_star_in_noise_is_no_difference() -> None:
    random = np.random.default_rng(8)
    stars, at = np.full((60, 60), 15.0), random.integers(4, 56, (6, 2))
    stars[at[:, 0], at[:, 1]] += random.exponential(900, 6)
    stars = cv2.GaussianBlur(stars, (0, 0), 1.2)
    one, other = (np.clip(stars + random.normal(0, 3, stars.shape), 0, 255).astype(np.uint8) for _ in range(2))
    assert shown(one, other[8:52, 8:52], 8, 8).kind == "same"


@pytest.mark.parametrize("full", [0.25, 0.4, 0.55, 0.7])
@pytest.mark.parametrize("more", [-0.12, 0.15])
def test_a_bar_that_is_full_to_another_part_is_not_partly_covered(full: float, more: float) -> None:
    def bar(full: float) -> Array:
        drawn = np.full((20, 96, 3), 245, np.uint8)
        cv2.rectangle(drawn, (3, 3), (92, 16), (215, 215, 215), -1)
        cv2.rectangle(drawn, (3, 3), (3 + round(90 * full), 16), (40, 120, 220), -1)
        return drawn

    assert shown(bar(full + more), bar(full), 0, 0).kind not in FOUND


def faint_word(other: bool) -> Array:
    """Return a label, a clear word over a faint one."""
    label = np.full((64, 110, 3), (40, 110, 160), np.uint8)
    cv2.putText(label, "Vivo", (16, 25), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (0, 0, 0), 2, cv2.LINE_AA)
    word = "Apple" if other else "Peach"
    cv2.putText(label, word, (16, 54), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (60, 135, 120), 1, cv2.LINE_AA)
    return label


def bars_of_a_code(other: bool) -> Array:
    bars = np.random.default_rng(0).random(40) < 0.5
    if other:
        bars[20:28] = np.random.default_rng(100).random(8) < 0.5
    code = np.full((48, 96, 3), 250, np.uint8)
    code[4:-4, 8:-8] = np.where(bars.repeat(2), 10, 250)[:, np.newaxis]
    return code


def round_spot(other: bool) -> Array:
    away = np.square(np.arange(36) - 17.5)
    spot = np.exp(-(away[:, np.newaxis] + away) / (2 * (4 if other else 6) ** 2))
    return np.rint(50 + 120 * spot).astype(np.uint8)


def battery(other: bool) -> Array:
    shown = np.full((26, 48, 3), GROUND, np.uint8)
    cv2.rectangle(shown, (0, 0), (47, 25), (30, 30, 30), 1)
    if not other:
        cv2.line(shown, (13, 13), (24, 13), (40, 170, 70), 13, cv2.LINE_AA)
    return shown


def choice(other: bool) -> Array:
    fine = np.full((31 * FINER, 55 * FINER, 3), GROUND, np.uint8)
    cv2.circle(fine, (24 * FINER, 24 * FINER), 11 * FINER, (60, 60, 60), FINER)
    if not other:
        cv2.circle(fine, (24 * FINER, 24 * FINER), 6 * FINER, BLUE, -1)
    return np.asarray(cv2.resize(fine[::-1], (55, 31), interpolation=cv2.INTER_AREA))


def large_icon(other: bool) -> Array:
    fine = np.full((86 * FINER, 86 * FINER, 3), (28, 26, 30), np.uint8)
    cv2.rectangle(fine, (3 * FINER, 3 * FINER), (83 * FINER, 83 * FINER), (255,) * 3, 2 * FINER)
    if other:
        cv2.circle(fine, (43 * FINER, 43 * FINER), 15 * FINER, (255,) * 3, -1)
    else:
        flag = np.array([(31, 60), (31, 28), (56, 28), (56, 44), (31, 44)]) * FINER
        cv2.polylines(fine, [flag], False, (255,) * 3, 2 * FINER)
    return np.asarray(cv2.resize(fine, (86, 86), interpolation=cv2.INTER_AREA))


@pytest.mark.parametrize("drawn", [faint_word, bars_of_a_code, round_spot, battery, choice, large_icon])
@pytest.mark.parametrize("other", [False, True])
def test_what_differs_in_a_faint_part_or_in_a_mark_of_the_same_ink_is_a_sibling(drawn, other):
    template, seen = drawn(other), drawn(not other)
    assert shown(seen, template, 0, 0).kind not in FOUND
    assert shown(template, template, 0, 0).kind == "same"


def card(mark: str) -> Array:
    """Return six equal marks of 7 px on a card, on a dark ground."""
    fine = np.full((60 * FINER, 46 * FINER, 3), (30, 110, 60), np.uint8)
    cv2.rectangle(fine, (4 * FINER, 4 * FINER), (42 * FINER, 56 * FINER), (252, 252, 250), -1)
    for row, col in product((14, 30, 46), (14, 32)):
        at = np.array([col, row])
        corners = {
            "up": [(0, -4), (4, 3), (-4, 3)],
            "down": [(0, 4), (4, -3), (-4, -3)],
            "diamond": [(0, -4), (4, 0), (0, 4), (-4, 0)],
            "cross": [(-3, -4), (0, -1), (3, -4), (4, -3), (1, 0), (4, 3), (3, 4), (0, 1), (-3, 4), (-4, 3), (-1, 0)],
        }[mark]
        cv2.fillPoly(fine, [(at + corners) * FINER], (20, 20, 20))
    return np.asarray(cv2.resize(fine, (46, 60), interpolation=cv2.INTER_AREA))


@pytest.mark.parametrize("spread", [0.3, 0.6])
def test_a_card_with_other_small_marks_is_a_sibling_though_all_blocks_differ_alike(spread: float) -> None:
    for mark, other in product(("up", "down", "diamond", "cross"), repeat=2):
        seen = cv2.GaussianBlur(card(other), (0, 0), spread)
        assert (shown(seen, card(mark), 0, 0).kind in FOUND) == (mark == other), (mark, other)


@pytest.mark.parametrize(("name", "row", "col"), [("cube", 404, 457), ("giraffes", 55, 481)])
def test_noise_is_no_other_mark(name: str, row: int, col: int) -> None:
    picture = read_image(stereo_pairs()[name].left)[:, :, :3]
    noisy = np.clip(picture + np.random.default_rng(0).normal(0, 10, picture.shape), 0, 255).astype(np.uint8)
    assert shown(noisy, picture[row : row + 60, col : col + 90], row, col).kind == "same"


def brick(long: int) -> Array:
    """Return a brick of so many units of 16 px in grey mortar, with light and dark edges and a stud on each unit."""
    drawn = np.full((22, 16 * long + 4, 3), (200, 200, 195), np.uint8)
    cv2.rectangle(drawn, (2, 2), (16 * long + 1, 19), (110, 20, 175), -1)
    cv2.line(drawn, (2, 19), (16 * long + 1, 19), (75, 15, 120), 1)
    for unit in range(long):
        cv2.circle(drawn, (10 + 16 * unit, 10), 4, (150, 40, 235), -1, cv2.LINE_AA)
    return drawn


@pytest.mark.parametrize("seen", [3, 4])
@pytest.mark.parametrize("spread", [0.3, 0.6])
def test_a_longer_brick_is_not_the_template_though_it_differs_in_the_rim_alone(seen: int, spread: float) -> None:
    wall = np.tile(np.hstack([brick(seen), brick(5)]), (3, 1, 1))
    picture = in_jpeg(np.asarray(cv2.GaussianBlur(wall, (0, 0), spread)))
    assert (shown(picture, brick(3), 22, 0).kind in FOUND) == (seen == 3)


@pytest.mark.parametrize("spread", [0.0, 0.7])
def test_a_hat_that_is_gone_is_not_covered(spread: float) -> None:
    picture = photograph(5)
    cv2.ellipse(picture, (130, 120), (22, 30), 0, 0, 360, (200, 150, 110), -1, cv2.LINE_AA)
    for col in (121, 139):
        cv2.circle(picture, (col, 112), 4, (30, 30, 30), -1, cv2.LINE_AA)
    cv2.ellipse(picture, (130, 132), (9, 5), 0, 10, 170, (150, 30, 30), 2, cv2.LINE_AA)
    hat = picture.copy()
    cv2.rectangle(hat, (114, 70), (146, 100), (20, 140, 150), -1)
    template = hat[76:152, 98:162].copy()
    seen, covered = (np.asarray(cv2.GaussianBlur(one, (0, 0), spread)) if spread else one for one in (picture, hat))
    covered[70:98, 110:150] = (160, 60, 160)
    assert shown(seen, template, 76, 98).kind not in FOUND
    assert shown(covered, template, 76, 98).kind == "partly_covered"


@pytest.mark.parametrize("upright", [False, True])
def test_stripes_are_found_where_they_are_and_not_moved_along_themselves(upright: bool) -> None:
    flag = np.zeros((44, 66, 3), np.uint8)
    for number, colour in enumerate([(255, 205, 0), (200, 20, 40), (0, 130, 70)]):
        flag[:, 22 * number : 22 * (number + 1)] = colour
    flag = flag if upright else np.ascontiguousarray(flag[:, :44].transpose(1, 0, 2))
    picture = np.full((160, 240, 3), (150, 170, 190), np.float64)
    picture[60 : 60 + flag.shape[0], 80 : 80 + flag.shape[1]] = flag
    noisy = np.clip(np.rint(picture + np.random.default_rng(0).normal(scale=5, size=picture.shape)), 0, 255)
    search = match_template(noisy.astype(np.uint8), flag)
    assert search.found and search.reason == "clear" and place(search) == (60, 80), search.best


@pytest.mark.parametrize("wanted", [5, 6, 20, 1000])
def test_copies_are_counted_without_their_sibling_however_many_are_wanted(wanted: int) -> None:
    template = icon("minus")
    image = screen(*[template] * 5, icon("plus"))
    search = match_template(image, template, max_matches=wanted)
    assert (search.clear, search.reason) == (5, "clear")
    assert (search.rivals[0].col, search.rivals[0].kind) == (320, "differs")
    assert not match_template(image, template, max_matches=4).found


@pytest.mark.parametrize("front", ["a photograph", "a colour"])
def test_what_something_in_front_hides_is_told(front: str) -> None:
    middle = np.s_[95:120, 120:155]
    for hidden in (np.s_[80:95, 100:180], np.s_[125:140, 100:180], np.s_[80:140, 160:180], middle):
        picture = photograph(0)
        template = picture[80:140, 100:180].copy()
        picture[hidden] = photograph(20)[hidden] if front == "a photograph" else (250, 250, 0)
        search = match_template(picture, template)
        assert (search.found, search.reason) == (True, "partly_covered"), hidden
        assert np.abs(np.subtract(place(search), (80, 100))).max() <= 1
        assert 0 < disagreeing(search.best) < 25


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
    assert search.score_map.shape == tuple(
        length - side + 1 for length, side in zip(picture[inside].shape, template.shape[:2], strict=False)
    )


def test_an_icon_cut_off_is_found_among_siblings_that_fit_as_well_but_for_their_marks() -> None:
    others = [icon(other) for other in MARKS if other != "minus"]
    icons = [icon("minus") if number == 3 else others[number % 4] for number in range(24)]
    rows = [
        np.hstack([np.pad(one, ((4, 4), (9, 9), (0, 0)), "edge") for one in icons[at : at + 8]]) for at in (0, 8, 16)
    ]
    search = match_template(np.vstack(rows)[14:], icon("minus"))
    assert search.found and place(search) == (-10, 159)


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
    ("seen", "sought", "reason"),
    [
        (icon("plus"), icon("plus"), "clear"),
        (icon("minus"), icon("plus"), "differs"),
        (icon("arrow")[:, ::-1], icon("arrow"), "mirrored"),
        (icon("bars") // 2 + 121, icon("bars"), "lower_contrast"),
        (icon("bars", (200, 40, 40)), icon("bars"), "other_colours"),
    ],
)
def test_a_verdict_holds_in_other_numbers_at_other_sizes_and_places(seen, sought, reason, change):
    if reason == "other_colours" and change == "grey":
        return
    search = match_template(CHANGES[change](screen(seen)), CHANGES[change](sought))
    assert search.reason == reason, (search.best, search.rivals[:1])


# Things that a screen draws over a place: the template is found beneath them, and a sibling in its box is not.

Thing = Callable[[Array, np.random.Generator], None]
Look = Callable[[Array], Array]
WORDS = ("Save", "Open", "Close", "Print", "Export", "Import", "Search", "Reset", "Undo", "Help", "Filter", "Apply")
BOX = np.s_[20:64, 20:130]


def button(word: str) -> Array:
    """Return a plain screen with a button of 96 × 30 px within the box."""
    picture = np.full((84, 150, 3), 245, np.uint8)
    cv2.rectangle(picture, (27, 27), (123, 57), (225, 230, 235), -1)
    cv2.rectangle(picture, (27, 27), (123, 57), (150, 155, 165), 1)
    cv2.putText(picture, word, (41, 47), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (30, 30, 40), 1, cv2.LINE_AA)
    return picture


def text_cursor(part: Array, random: np.random.Generator) -> None:
    row, col = int(random.integers(4, 22)), int(random.integers(12, 90))
    part[row : row + 17, col : col + int(random.integers(1, 3))] = 0


def arrow(part: Array, random: np.random.Generator) -> None:
    at = np.array([(1, 1), (1, 17), (5, 13.5), (8, 20), (10.5, 19), (7.5, 12.5), (12.5, 12.5)])
    corners = np.rint(16 * (at + random.uniform([4, 4], [part.shape[1] - 20, 20]))).astype(np.int32)
    cv2.fillPoly(part, [corners], (255, 255, 255), cv2.LINE_AA, 4)
    cv2.polylines(part, [corners], True, (0, 0, 0), 1, cv2.LINE_AA, 4)


def focus_ring(part: Array, random: np.random.Generator) -> None:
    away = int(random.integers(1, 5))
    cv2.rectangle(part, (away, away), (109 - away, 43 - away), (140, 165, 215), 1)


def selection(part: Array, random: np.random.Generator) -> None:
    rows = part[: int(random.integers(15, 36))]
    rows[:] = np.rint(0.7 * rows + 0.3 * np.array([0, 90, 220]))


def shadow(part: Array, random: np.random.Generator) -> None:
    away: Array = np.zeros(part.shape[:2], np.float32)
    away[9:41, 8:106] = random.uniform(0.3, 0.5)
    away = np.asarray(cv2.GaussianBlur(away, (0, 0), float(random.uniform(1.5, 4))), np.float32)
    away[7:38, 7:104] = 0
    part[:] = np.rint(part * (1 - away[:, :, np.newaxis]))


def scroll_bar(part: Array, random: np.random.Generator) -> None:
    part[:, -int(random.integers(9, 15)) :] = 190
    part[8:24, -6:] = 110


def badge(part: Array, random: np.random.Generator) -> None:
    cv2.circle(part, (102, 8), 7, (220, 30, 40), -1, cv2.LINE_AA)


THINGS = (text_cursor, arrow, focus_ring, selection, shadow, scroll_bar, badge)


@pytest.mark.parametrize(("seed", "thing"), [*enumerate(THINGS, 6)])
def test_a_word_is_found_with_a_thing_over_it_and_another_word_in_the_same_box_is_not(seed: int, thing: Thing) -> None:
    words = np.random.default_rng(seed).permutation(WORDS)[:2].tolist()
    same, other = (button(word) for word in words)
    template = same[BOX].copy()
    for picture in (same, other):
        thing(picture[BOX], np.random.default_rng(seed))
    assert shown(same, template, 20, 20).kind in FOUND
    assert shown(other, template, 20, 20).kind not in FOUND


def test_where_all_differs_a_dark_spot_of_it_is_no_shadow() -> None:
    row, col = np.ogrid[:60, :80]
    spot = 150 * np.exp(-((row - 30) ** 2 + (col - 40) ** 2) / 72)
    template = np.clip(100 + 45 * np.sin(col / 6) + spot, 0, 255).astype(np.uint8)
    other = (100 + 10 * np.sin(col / 6) + 10 * np.sin(row / 5)).astype(np.uint8)
    assert shown(other, template, 0, 0).kind not in FOUND


def test_a_disc_over_an_eighth_of_a_button_is_a_part_of_it() -> None:
    picture = button("Save")
    template = picture[BOX].copy()
    cv2.circle(picture[BOX], (20, 22), 19, (220, 30, 40), -1, cv2.LINE_AA)
    assert shown(picture, template, 20, 20).kind not in FOUND


@pytest.mark.parametrize("seed", [0, 2])
def test_where_all_but_its_faint_ground_is_hidden_nothing_is_found(seed: int) -> None:
    picture, taken, other = np.full((150, 200, 3), 128, np.uint8), photograph(seed), photograph(seed + 50)
    template = np.rint(128 + 0.25 * (taken[40:110, 60:140] - 128.0)).astype(np.uint8)
    template[15:55, 18:62] = taken[55:95, 78:122]
    picture[40:110, 60:140] = template
    picture[54:96, 77:123] = other[20:62, 20:66]
    assert shown(picture, template, 40, 60).kind not in FOUND


def as_it_is(picture: Array) -> Array:
    return picture


def in_jpeg(picture: Array) -> Array:
    return np.asarray(cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 55])[1], 1), np.uint8)


def darker(picture: Array) -> Array:
    return np.asarray(np.rint(0.8 * picture + 25), np.uint8)


@pytest.mark.parametrize(("seed", "seen"), [*enumerate((as_it_is, in_jpeg, darker))])
@pytest.mark.parametrize("chosen", [0, 2])
def test_another_choice_beside_that_of_the_template_is_not_in_front_of_it(seed: int, chosen: int, seen: Look) -> None:
    word = str(np.random.default_rng(seed).choice(WORDS))

    def row(choice: int) -> Array:
        drawn = np.full((60, 220, 3), 250, np.uint8)
        cv2.putText(drawn, word, (12, 34), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40,) * 3, 1, cv2.LINE_AA)
        cv2.rectangle(drawn, (130, 20), (190, 40), (235,) * 3, -1)
        cv2.rectangle(drawn, (130, 20), (190, 40), (150,) * 3, 1)
        cv2.rectangle(drawn, (132 + 20 * choice, 22), (148 + 20 * choice, 38), (90,) * 3, -1)
        return drawn

    assert shown(seen(row(1)), row(chosen)[16:44, 6:206], 16, 6).kind not in FOUND


@pytest.mark.parametrize(("seed", "reach"), [(0, 7), (1, 9), (2, 7), (3, 9)])
def test_another_digit_in_the_badge_of_the_template_is_a_sibling(seed: int, reach: int) -> None:
    random = np.random.default_rng(seed)
    word, (one, other) = str(random.choice(WORDS)), random.permutation(9)[:2] + 1

    def with_badge(digit: int) -> Array:
        picture = button(word)
        cv2.circle(picture, (122, 29), reach, (220, 30, 40), -1, cv2.LINE_AA)
        cv2.putText(picture, str(digit), (118, 33), cv2.FONT_HERSHEY_PLAIN, 0.8, (255, 255, 255), 1, cv2.LINE_AA)
        return picture

    kinds = [shown(with_badge(digit), with_badge(one)[BOX], 20, 20).kind for digit in (one, other)]
    assert kinds[0] == "same" and kinds[1] not in FOUND


@pytest.mark.parametrize(("printed", "other"), [("LM737", "LM757"), ("LM553", "LM563")])
def test_out_of_focus_a_part_is_found_and_one_with_another_value_printed_is_not(printed: str, other: str) -> None:
    """The pins differ more from sharp ones than the digits from one another; what is beyond the rim is mixed in."""

    def part(text: str) -> Array:
        drawn = np.full((40, 72, 3), (25, 85, 45), np.uint8)
        drawn[:, 10:66][:, np.arange(56) % 8 < 4] = 200
        drawn[6:34, 6:66] = 30
        cv2.putText(drawn, text, (17, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (200, 200, 200), 1, cv2.LINE_AA)
        return drawn

    kinds = []
    for text in (printed, other):
        picture = photograph(0)
        picture[60:100, 100:172] = part(text)
        seen = cv2.GaussianBlur(picture, (0, 0), 1) + np.random.default_rng(0).normal(0, 4, picture.shape)
        kinds.append(shown(np.clip(seen, 0, 255).astype(np.uint8), part(printed), 60, 100).kind)
    assert kinds[0] == "same" and kinds[1] not in FOUND


def test_what_a_blur_or_jpeg_mixes_into_the_rim_is_no_difference() -> None:
    """Of a tag in colours on another ground, whose digits differ less than its corners."""

    def tag(text: str) -> Array:
        drawn = np.full((34, 64, 3), (250, 210, 40), np.uint8)
        cv2.putText(drawn, text, (8, 23), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (190, 20, 20), 2, cv2.LINE_AA)
        return drawn

    kinds = []
    for text in ("4.75", "4.15"):
        picture = np.full((100, 140, 3), (90, 100, 120), np.uint8)
        picture[31:65, 41:105] = tag(text)
        kinds.append(shown(in_jpeg(cv2.GaussianBlur(picture, (0, 0), 0.7)), tag("4.75"), 31, 41).kind)
    assert kinds[0] == "same" and kinds[1] not in FOUND


@pytest.mark.parametrize("ground", [0, 255])
def test_a_template_as_large_as_what_it_shows_is_found_out_of_focus(ground: int) -> None:
    disc, picture = np.full((36, 36), 200, np.uint8), photograph(1)[:, :, 0]
    for row, col in ((9, 9), (18, 18), (27, 27)):
        cv2.circle(disc, (col, row), 3, 40, -1, cv2.LINE_AA)
    picture[50:110, 90:150] = ground
    picture[60:96, 100:136] = disc
    seen = cv2.GaussianBlur(picture, (0, 0), 0.8)[:, :, np.newaxis]
    assert shown(seen, disc[:, :, np.newaxis], 60, 100).is_template
