"""Charts: their lines, marks and grids stand where the results are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.verdict import common, drifting, tones, unrelated
from stereolag import CorrelationMatcher, signal_lag
from stereolag.assess.explaining import window_start
from stereolag.core.arrays import Box
from stereolag.figures import recordings
from stereolag.figures.match import MAX_PER_SIDE, WindowGrid, overlap_figure, window_grid
from stereolag.signals.correlation import overlap_slices
from tests.app.uploads import noise


@pytest.mark.parametrize("count", [10, recordings.MAX_POINTS, 50_000])
def test_a_line_holds_as_many_points_as_are_seen(count: int) -> None:
    figure = recordings.waveforms(noise(count), noise(count, 1), 8_000)
    assert all(min(count, recordings.MAX_POINTS - 2) <= len(trace.x) <= recordings.MAX_POINTS for trace in figure.data)
    assert all(trace.x[0] == 0 and trace.x[-1] == pytest.approx((count - 1) / 8_000) for trace in figure.data)
    assert all(trace.y.dtype == np.float32 for trace in figure.data)


@pytest.mark.parametrize("lag", [-300, 0, 300])
def test_the_lag_is_undone(lag: int) -> None:
    sound = noise(2_000)
    first, second = sound[max(0, lag) :][:1_500], sound[max(0, -lag) :][:1_500]
    over = recordings.aligned(first, second, lag, 1.0)
    assert over.data[1].x[0] - over.data[0].x[0] == -lag
    shared, _ = overlap_slices(first.size, second.size, lag)
    for position in (shared.start, recordings.highest_energy_start(first, shared), shared.stop - 1):
        near = recordings.close_up(first, second, lag, position)
        assert 1 <= len(near.data[0].y) <= recordings.CLOSE_UP_SAMPLES
        assert np.allclose(near.data[0].y, near.data[1].y, atol=0.2)  # each in units of its own standard deviation
    quiet = 0.01 * noise(5_000)
    quiet[3_000:3_200] *= 100
    assert abs(recordings.highest_energy_start(quiet, slice(0, 5_000)) - 3_000) < 20


def test_a_tone_has_its_rivals_marked_and_no_band_of_chance_that_covers_its_peaks() -> None:
    result = signal_lag(*tones(6_000, 0.01, 0.0, 0))
    drawn = {trace.name: trace for trace in recordings.correlation_curve(result, "").data}
    assert tuple(drawn["fits as well"].x) == result.rivals
    assert result.judgement.ribbon[1] > result.correlation.max() and "chance" not in drawn


def test_the_drawn_curve_reaches_every_marked_lag_and_all_lags_around_the_peak() -> None:
    sound = np.random.default_rng(12).normal(size=60_000)
    result = signal_lag(sound, np.pad(sound, (500, 0))[:60_000] + 0.5 * np.pad(sound, (30_000, 0))[:60_000])
    curve, arrival, peak = recordings.correlation_curve(result, "").data[1:]
    drawn = dict(zip(curve.x.tolist(), curve.y.tolist(), strict=True))
    assert (arrival.name, arrival.x.tolist(), peak.x) == ("another arrival", [30_000], (500,))
    assert [drawn[arrival.x[0]], drawn[500]] == pytest.approx([arrival.y[0], peak.y[0]])
    assert set(range(300, 700)) < set(drawn)
    # As high and as low around every place as the whole curve is there.
    for low in range(-59_000, 59_000, 1_000):
        whole = result.correlation[(result.lags >= low) & (result.lags < low + 1_000)]
        shown = [value for lag, value in drawn.items() if low - 130 <= lag < low + 1_130]
        assert max(shown) > whole.max() - 1e-6 and min(shown) < whole.min() + 1e-6


def test_a_peak_at_the_right_end_has_its_label_on_the_left() -> None:
    sound = noise(6_000)
    for pair, side in (((sound[5_800:], sound), "left"), ((sound, sound[5_800:]), "right")):
        label = recordings.correlation_curve(signal_lag(*pair), "").data[-1]
        assert label.textposition == f"middle {side}"


def test_the_lags_of_a_drift_are_marked_from_the_lowest_to_the_highest() -> None:
    result = signal_lag(*drifting(150_000, 400, 900.0, 0.1, 1), max_lag=2000)
    figure = recordings.correlation_curve(result, "")
    (range_,) = figure.layout.shapes
    assert (range_.x0, range_.x1) == pytest.approx((400, 535), abs=1)
    assert [one.text for one in figure.layout.annotations] == ["400 to 535"]


def test_a_reversed_microphone_is_marked_at_its_trough() -> None:
    sound = noise(5_000)
    result = signal_lag(sound[1_000:], -sound[:4_000])
    trough = next(one for one in recordings.correlation_curve(result, "").data if one.name == "opposite sign")
    assert trough.x.tolist() == [1_000]
    assert trough.y[0] < -0.8
    assert trough.text[0].strip() == "1,000"


def test_votes_for_one_lag_alone_stand_on_an_axis_with_room_around_them() -> None:
    result = signal_lag(*common(20_000, 300, 0), method="sampled", seed=0)
    assert result.votes is not None and len(result.votes) == 1
    axis = recordings.correlation_curve(result, "votes").layout.xaxis
    assert axis.range[0] < 290 and axis.range[1] > 310


def test_no_chance_level_is_below_loud_moments_that_share_nothing() -> None:
    random = np.random.default_rng(3)
    first, second = 0.01 * random.normal(size=(2, 8_000))
    first[3_000:3_060] += random.normal(size=60)
    second[5_000:5_060] += random.normal(size=60)
    result = signal_lag(first, second)
    assert result.verdict == "nothing"
    assert result.correlation.max() > result.judgement.ribbon[1]
    assert "chance" not in {trace.name for trace in recordings.correlation_curve(result, "").data}


def test_the_ribbon_holds_what_chance_gives_and_widens_for_plain_pearson() -> None:
    pair = unrelated("noise and noise", 20_000, 3)
    result = signal_lag(*pair)
    ribbon = recordings.correlation_curve(result, "").data[0]
    assert max(ribbon.y) - min(ribbon.y) == pytest.approx(2 * max(ribbon.y), rel=0.05)
    assert ((result.correlation < max(ribbon.y)) & (result.correlation > min(ribbon.y))).mean() > 0.99
    plain = np.array(recordings.correlation_curve(result, "", sizes=(pair[0].size, pair[1].size)).data[0].y)
    assert plain[0] == 1.0 and plain[plain.size // 4] == pytest.approx(max(ribbon.y), rel=0.05)


@pytest.mark.parametrize("lost", [0, 700])
def test_the_lag_of_blocks_is_drawn_over_time_with_a_line_for_each_stretch(lost: int) -> None:
    first, second = drifting(150_000, 400, 50.0, 0.0, 1)
    result = signal_lag(first, np.delete(second, slice(70_000, 70_000 + lost)), max_lag=2000)
    line, blocks = recordings.lag_over_time(result.over_time, 44_100.0).data
    assert len(blocks.x) == result.over_time.blocks
    slope = (line.y[1] - line.y[0]) / (line.x[1] - line.x[0]) / 44_100
    assert 1e6 * slope == pytest.approx(50.0, abs=5)
    if lost:
        assert line.x[1] == line.x[2] == pytest.approx(69_600 / 44_100, abs=1e-3)
        assert line.y[1] - line.y[2] == pytest.approx(lost, abs=0.2)


def test_the_histogram_holds_every_run_and_the_median() -> None:
    seconds = np.random.default_rng(0).uniform(0.01, 0.02, 51)
    figure = recordings.run_times(seconds)
    assert len(figure.data[0].x) == 51
    assert figure.layout.shapes[0].x0 == pytest.approx(1e3 * np.median(seconds))


SHAPE = 300, 400


def grid_at(row: int, col: int, size: int, overlap: float) -> WindowGrid:
    step = CorrelationMatcher(window_size=size, overlap=overlap).step
    top, left = (window_start(at, end, size, step) for at, end in zip((row, col), SHAPE, strict=True))
    return window_grid(SHAPE, Box(top, left, size, size), step)


@given(size=st.integers(3, 255), overlap=st.floats(0, 0.99), row=st.integers(0, 299), col=st.integers(0, 399))
def test_every_window_is_of_the_map_and_the_figure_is_legible(size: int, overlap: float, row: int, col: int) -> None:
    grid = grid_at(row, col, size, overlap)
    every_row, every_col = (set(range(0, side - size + 1, grid.step)) for side in SHAPE)
    part, half = grid.part, (size - 1) / 2
    # The reference counts all windows of the map one by one.
    counted = [
        sum(first <= start + half < first + length for start in starts)
        for starts, first, length in ((every_row, part.row, part.height), (every_col, part.col, part.width))
    ]
    assert grid.values == counted[0] * counted[1]
    assert set(grid.rows.tolist()) <= every_row
    assert set(grid.cols.tolist()) <= every_col
    near = grid.neighbours()
    assert (grid.middle.row, grid.middle.col) in near
    assert 1 <= len(near) <= 9
    for top, left in near:
        assert part.row <= top <= part.row + part.height - size
        assert part.col <= left <= part.col + part.width - size
    # Neighbours stay some px apart on the screen, whatever the settings.
    assert grid.every * grid.step >= size / MAX_PER_SIDE
    assert grid.drawn(grid.rows, grid.middle.row).size <= 4 * MAX_PER_SIDE


def test_the_figure_has_the_windows_their_centres_and_the_part_of_the_image() -> None:
    image = np.random.default_rng(3).integers(0, 255, (*SHAPE, 3), dtype=np.uint8)
    grid = grid_at(150, 200, 20, 0.9)
    assert (grid.step, grid.values, grid.every) == (2, 17 * 17, 1)
    figure = overlap_figure(image, grid)
    assert len(figure.layout.shapes) == 9
    assert {shape.x1 - shape.x0 for shape in figure.layout.shapes} == {20}
    assert sorted({shape.x0 for shape in figure.layout.shapes}) == [grid.middle.col + at - 0.5 for at in (-2, 0, 2)]
    others, own = figure.data
    assert len(others.x) + 1 == grid.values
    assert (own.y[0], own.x[0]) == (grid.middle.row + 9.5, grid.middle.col + 9.5)
    # Rows grow downwards on the screen as in the image, and pixels are square.
    assert figure.layout.yaxis.range[0] > figure.layout.yaxis.range[1]
    assert figure.layout.yaxis.scaleanchor == "x"
    (picture,) = figure.layout.images
    assert (picture.sizex, picture.sizey) == (grid.part.width, grid.part.height)
    corner = grid_at(0, 399, 20, 0.5)
    assert (corner.part.row, corner.part.col + corner.part.width) == (0, 400)
    assert len(corner.neighbours()) == 4
    with pytest.raises(ValueError, match=r"\(3, 4\) is not on a grid of step 2"):
        window_grid(SHAPE, Box(3, 4, 20, 20), 2)
