from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from stereolag.templates import exact_pixels, match_template
from stereolag.templates.by_hand import (
    MOST_ANCHORS,
    MOST_DOTS,
    Anchor,
    anchors,
)
from stereolag.templates.exact_pixels import anchor_stages
from stereolag.templates.patterns import opaque_pixels, pattern_of, same_channels

PLACE = (23, 41)


def scene(colours: int = 40, seed: int = 0) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return a picture with few colours, and a round RGBA sprite drawn into it."""
    random = np.random.default_rng(seed)
    palette = random.integers(0, 256, (colours, 3), dtype=np.uint8)
    image = palette[random.integers(0, colours, (90, 120))]
    sprite = np.zeros((15, 17, 4), dtype=np.uint8)
    rows, cols = np.mgrid[:15, :17]
    opaque = (rows - 7) ** 2 + (cols - 8) ** 2 <= 49
    sprite[opaque, :3] = palette[random.integers(0, colours, opaque.sum())]
    sprite[opaque, 3] = 255
    image[23:38, 41:58][opaque] = sprite[opaque, :3]
    return image, sprite


def by_looking(
    image: npt.NDArray[Any], sprite: npt.NDArray[Any], anchor: Anchor
) -> tuple[set[Any], set[Any], set[Any]]:
    """Return the positions left by every stage, each position tried in turn."""
    height, width = sprite.shape[:2]
    places = [(row, col) for row in range(image.shape[0] - height + 1) for col in range(image.shape[1] - width + 1)]

    def agrees(place: tuple[int, int], col: int) -> bool:
        return bool((image[place[0] + anchor.row, place[1] + col] == sprite[anchor.row, col, :3]).all())

    coloured = {place for place in places if agrees(place, anchor.col)}
    agreeing = {place for place in coloured if all(agrees(place, end) for end in anchor.run)}
    scored = {(row + down, col + right) for row, col in agreeing for down in (-1, 0, 1) for right in (-1, 0, 1)}
    return coloured, agreeing, scored & set(places)


def test_each_stage_keeps_the_places_that_one_finds_by_looking() -> None:
    image, sprite = scene()
    found = anchors(image, sprite, None)
    assert 8 <= len(found) <= MOST_ANCHORS
    for anchor in found:
        stages = by_looking(image, sprite, anchor)
        assert anchor.counts == (90 * 120, *map(len, stages))
        for places, dots in zip(stages, anchor.dots, strict=True):
            held = {(row + anchor.row, col + anchor.col) for row, col in places}
            assert held >= set(dots) and len(dots) == len(set(dots))
            assert held == set(dots) or MOST_DOTS / 2 < len(dots) <= MOST_DOTS
        assert anchor.colour == tuple(sprite[anchor.row, anchor.col, :3].tolist())
        assert sprite[anchor.row, anchor.run[0] : anchor.run[1] + 1, 3].all()
        assert anchor.best is not None and anchor.best[:2] == PLACE
        assert anchor.best[2] == pytest.approx(1)


def test_the_colours_differ_and_the_first_is_what_the_search_takes() -> None:
    image, sprite = scene()
    found = anchors(image, sprite, None, seed=5)
    assert len({anchor.colour for anchor in found}) == len(found)
    search = match_template(image, sprite, method="sampled", seed=5)
    assert search.candidates == found[0].counts[3]


def test_half_transparent_colours_and_a_mask_leave_their_pixels_out() -> None:
    image, sprite = scene()
    mask = np.zeros(sprite.shape[:2], dtype=np.uint8)
    mask[3:9, 5:12] = 1
    for anchor in anchors(image, sprite, mask):
        assert 3 <= anchor.row < 9
        assert anchor.run == (5, 11)


def test_many_dots_are_thinned_and_too_many_places_not_scored() -> None:
    random = np.random.default_rng(0)
    image = random.integers(0, 3, (400, 500), dtype=np.uint8)
    template = image[100:220, 200:330]
    for anchor in anchors(image, template, None):
        assert anchor.counts[1] > 20_000
        assert MOST_DOTS / 2 < len(anchor.dots[0]) <= MOST_DOTS
        assert anchor.best is None


def test_a_template_of_many_colours_offers_rare_and_common_ones() -> None:
    random = np.random.default_rng(0)
    image = (random.normal(128, 25, (200, 300)).clip(0, 255)).astype(np.uint8)
    found = anchors(image, image[40:90, 60:130], None)
    assert len(found) == MOST_ANCHORS
    counts = [anchor.counts[1] for anchor in found]
    assert max(counts) > 20 * min(counts)
    assert np.mean(counts[:8]) < np.mean(counts[8:])


def test_a_template_that_was_changed_leaves_none() -> None:
    image, sprite = scene()
    sprite[:, :, :3] = sprite[:, :, :3] // 2 + 1
    assert all(anchor.best is None or anchor.best[2] < 0.9 for anchor in anchors(image, sprite, None))


def test_types_that_differ_are_refused() -> None:
    image, sprite = scene()
    with pytest.raises(ValueError, match="image holds uint16 and template uint8"):
        anchors(image.astype(np.uint16), sprite, None)


def test_the_stages_of_the_library_are_places_of_the_template() -> None:
    image, sprite = scene()
    searched, colours = same_channels(image, sprite)
    pattern = pattern_of(colours, opaque_pixels(sprite, None))
    stages = anchor_stages(np.ascontiguousarray(searched), pattern, 7, 8)
    assert stages.run == (1, 15)
    for rows, cols in (stages.coloured, stages.agreeing, stages.scored):
        assert PLACE in set(zip(rows.tolist(), cols.tolist(), strict=True))


def test_without_a_find_the_anchor_that_came_closest_tells_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    image, sprite = scene()
    image[23:32, 41:58] = 77  # the upper part is covered
    searched, colours = same_channels(image, sprite)
    pattern = pattern_of(colours, opaque_pixels(sprite, None))
    every = exact_pixels.rare_pixels(searched, pattern, 0)

    def best_of(anchors: list[tuple[int, int]]) -> float:
        monkeypatch.setattr(exact_pixels, "rare_pixels", lambda *_: anchors)
        found = exact_pixels.exact_positions(searched, pattern, 1.0, 0, lambda _: None)
        return float(np.fmax.reduce(found.scores, initial=-1.0))

    alone = [best_of([anchor]) for anchor in every]
    assert max(alone) < 1 and alone[-1] < max(alone)
    assert best_of(every) == max(alone)
