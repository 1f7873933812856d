"""Formulas that the browser computes while something is moved by hand: they give what the library gives."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from stereolag import CorrelationMatcher, SearchArea, read_signal, samples
from stereolag.assess.explaining import explain_match
from stereolag.core.inputs import as_grey
from stereolag.core.typography import typeset
from stereolag.pair_sources import example_pair
from stereolag.signals import by_hand, phasors
from stereolag.templates.by_hand import ReducedSearch, reduced_search
from stereolag.ui.depth.explaining import browser_settings
from stereolag.ui.lag.panels import described_phasors
from stereolag.ui.search.inputs import example_pictures, packed_mask, read_packed_mask
from tests.web.node import Node


@pytest.fixture(scope="module")
def node() -> Iterator[Node]:
    node = Node()
    yield node
    node.stop()


# A recording slid over another


SLIDES = {
    "Seven numbers": by_hand.seven_numbers,
    "Pure tone": by_hand.tone,
    "Unrelated noise": by_hand.noise,
    "Loud stretch": by_hand.loud_stretch,
}


@pytest.mark.parametrize("name", SLIDES)
@pytest.mark.parametrize("normalise", [False, True])
def test_products_are_those_of_numpy(node: Node, name: str, normalise: bool) -> None:
    slide = SLIDES[name]()
    example = {"cut": slide.cut.tolist(), "recording": slide.recording.tolist()}
    found = node.call("sliding/sliding.js", "({ measured }, given) => measured(...given)", [example, normalise])
    windows = sliding_window_view(slide.recording, slide.cut.size)
    expected = [np.corrcoef(window, slide.cut)[0, 1] for window in windows] if normalise else windows @ slide.cut
    np.testing.assert_allclose(found["values"], expected, atol=1e-9)
    np.testing.assert_allclose(np.sum(found["products"], axis=1), expected, atol=1e-9)


# Arrows turned back


def coast() -> phasors.Phasors:
    example = samples.recordings()["coast"]
    first, second = (read_signal(path).channels[0] for path in (example.signal_1, example.signal_2))
    found = phasors.common_stretch("coast", first, second, example.lag)
    assert found is not None
    return found


ARROWS: dict[str, Callable[[], phasors.Phasors]] = {
    "knock": phasors.knock,
    "coast": coast,
    "tone": phasors.tone,
    "noise": phasors.noise,
}

CHAIN_ARROWS = "({ chained }, [example, lengths, lags]) => lags.map((lag) => chained(example, lengths, lag))"


@pytest.mark.parametrize("name", ARROWS)
@pytest.mark.parametrize("whiten", [False, True])
def test_the_chain_of_arrows_ends_where_numpy_correlates(node: Node, name: str, whiten: bool) -> None:
    example = described_phasors(ARROWS[name](), **{"try": ""})
    measured = example["measured"]["whitened" if whiten else "plain"]
    lags, tips = phasors.LAGS, phasors.chains(ARROWS[name](), whiten=whiten)
    found = np.array(node.call("phasors/phasors.js", CHAIN_ARROWS, [example, measured["lengths"], lags.tolist()]))
    np.testing.assert_allclose(found[:, 1:] @ [1, 1j], tips, atol=2e-5)
    np.testing.assert_allclose(found[:, -1, 0], measured["values"], atol=2e-5)
    best = lags[measured["peaks"][0]]
    assert best == {"knock": 4, "coast": 4, "tone": -1}.get(name, lags[np.argmax(measured["values"])])


# A template dragged over an image

SCORE = """({ prepared, compared }, { picture, template, places }) => {
  const pixels = (one) => ({ ...one, data: Uint8ClampedArray.from(one.data) });
  const sought = prepared(pixels(template));
  return places.map(([row, col]) => compared(pixels(picture), sought, row, col));
}"""


def scored(node: Node, search: ReducedSearch, places: list[tuple[int, int]]) -> list[list[float]]:
    def told(pixels: np.ndarray, opaque: object = True) -> dict[str, object]:
        data = np.dstack([pixels, np.broadcast_to(np.uint8(255) * opaque, pixels.shape[:2])])
        return {"rows": pixels.shape[0], "cols": pixels.shape[1], "data": data.ravel().tolist()}

    given = {"picture": told(search.picture), "template": told(search.template, search.opaque), "places": places}
    found: list[list[float]] = node.call("template_by_hand/template_by_hand.js", SCORE, given)
    return found


@pytest.mark.parametrize("name", ["maze", "maze_dulled"])
def test_a_template_scores_as_in_the_library(node: Node, name: str) -> None:
    inputs = example_pictures(name)
    search = reduced_search(inputs.picture, inputs.template, inputs.mask, pixels=40_000)
    rows, cols = search.score_map.shape
    random = np.random.default_rng(0)
    chosen = [(int(random.integers(rows)), int(random.integers(cols))) for _ in range(200)]
    places = [(0, 0), (rows - 1, cols - 1), search.leaders[0][:2], *chosen]
    found = scored(node, search, places)
    expected = [search.score_map[place] for place in places]
    np.testing.assert_allclose([np.mean(products) for products in found], expected, atol=2e-6)
    assert len(found[0]) == np.count_nonzero(search.opaque)


def test_a_flat_window_has_no_score(node: Node) -> None:
    picture = np.full((30, 40, 3), 77, dtype=np.uint8)
    picture[10:, 20:] = np.random.default_rng(0).integers(0, 256, (20, 20, 3))
    search = reduced_search(picture, picture[12:20, 22:32], None)
    flat, found = scored(node, search, [(0, 0), (12, 22)])
    assert np.isnan(search.score_map[0, 0]) and not np.any(flat)
    assert np.mean(found) == pytest.approx(1)


def test_masks_are_packed_alike(node: Node) -> None:
    mask = np.random.default_rng(1).random((13, 7)) < 0.5
    unpack = "({ packed, unpacked }, text) => [packed(unpacked(text, 91)), unpacked(text, 91)]"
    found, painted = node.call("brush/brush.js", unpack, packed_mask(mask))
    assert found == packed_mask(mask)
    np.testing.assert_array_equal(np.reshape(painted, mask.shape), ~mask)
    np.testing.assert_array_equal(read_packed_mask(found, mask.shape) > 0, mask)


# The match under the pointer

EXPLAIN = """({ explained }, { settings, rows, cols, left, right, deviation, pixels }) => {
  const pair = { rows, cols, left: Uint8Array.from(left), right: Uint8Array.from(right), deviation };
  return pixels.map(([row, col]) => explained(pair, settings, row, col));
}"""

ROWS, COLS = slice(240, 370), slice(180, 430)
PIXELS = [[65, 120], [60, 200], [90, 150], [5, 3], [100, 230], [30, 100]]


@pytest.mark.parametrize(
    "settings",
    [
        {"window_size": 15, "search": SearchArea.rectified(64)},
        {"window_size": 16, "overlap": 0.5, "search": SearchArea.rectified(48, 4, vertical=2)},
        {"window_size": 15, "search": SearchArea.centred(61)},
        {"window_size": 20, "search": SearchArea.centred(20)},
        {"window_size": 11, "search": SearchArea.rectified(64), "score": "ncc"},
        {"window_size": 11, "search": SearchArea.rectified(40), "score": "cross"},
    ],
    ids=str,
)
def test_a_match_is_explained_as_in_the_library(node: Node, settings: dict[str, Any]) -> None:
    matcher, fence = CorrelationMatcher(**settings), example_pair(samples.stereo_pairs()["fence"])
    left, right = (np.ascontiguousarray(as_grey(image)[ROWS, COLS]) for image in (fence.left, fence.right))
    asked = {
        "settings": browser_settings(matcher, left, right),
        "rows": left.shape[0],
        "cols": left.shape[1],
        "left": left.ravel().tolist(),
        "right": right.ravel().tolist(),
        "deviation": float(left.std()),
        "pixels": PIXELS,
    }
    found = node.call("hovered_match/scoring.js", EXPLAIN, asked)

    def lag(place: dict[str, int] | None) -> tuple[int, int] | None:
        return (place["dy"], place["dx"]) if place else None

    for (row, col), seen in zip(PIXELS, found, strict=True):
        expected = explain_match(matcher, left, right, row, col)
        scale = max(1.0, abs(expected.peak_score))
        scores = np.array(seen["scores"], dtype=float).reshape(expected.surface.shape)
        np.testing.assert_allclose(scores / scale, expected.surface / scale, atol=1e-4)
        assert seen["kind"] == expected.kind
        assert lag(seen["peak"]) == expected.peak
        assert lag(seen["runnerUp"]) == expected.runner_up
        assert seen["contrast"] == pytest.approx(expected.contrast)


# Numbers


@pytest.mark.parametrize("number", [0.0, -0.0, -0.004, 0.25, -31_234.0, 1_234_567.891])
@pytest.mark.parametrize("digits", [0, 2])
def test_numbers_are_written_as_python_writes_them(node: Node, number: float, digits: int) -> None:
    found = node.call(
        "shared/numbers.js", "({ shortened }, [number, digits]) => shortened(number, digits, 'px')", [number, digits]
    )
    assert found == typeset(f"{number:z,.{digits}f} px")
