"""Recordings and their correlation as Plotly figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from tsdownsample import MinMaxDownsampler

from stereolag.core.arrays import Vector
from stereolag.core.typography import typeset
from stereolag.figures.charts import LEGEND_ABOVE, laid_out, rings
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.signals import SignalLag
from stereolag.signals.correlation import overlap_length, overlap_slices
from stereolag.signals.over_time import LagOverTime
from stereolag.signals.verdict import LagJudgement

MAX_POINTS = 2_000
"""Largest number of points drawn per line, however long: about two for every pixel of its width."""

CLOSE_UP_SAMPLES = 200
"""As in Fig. 1.5b of the report."""

VOTES_SHOWN = 200
"""Number of lags shown with their votes."""

RIBBON_POINTS = 257
"""Number of points along either edge of the ribbon of chance."""

FULL_DETAIL_LAGS = 250
"""Lags on either side of the peak that are all drawn, so that its shape is visible when zoomed in."""

LABEL_MARGIN_PX = 28
"""Margin above a curve that has a label there, px."""

LABEL_LEFT_SHARE = 0.8
"""Share of the axis beyond which a label is to the left of its point."""

DOUBTFUL_COLOUR = "#8a8a8a"
"""Colour of a peak that is not sure, and of its rivals."""

LEGEND_LAYOUT: dict[str, Any] = {"legend": LEGEND_ABOVE, "hovermode": "x unified"}
NO_LEGEND_LAYOUT: dict[str, Any] = {"showlegend": False, "hovermode": "closest"}

CLOCK_TITLE = "seconds on the clock of sensor 1"


def waveforms(signal_1: Vector, signal_2: Vector, sampling_rate: float) -> go.Figure:
    """Return both recordings before alignment, one above the other, on the same time axis."""
    figure = make_subplots(rows=2, shared_xaxes=True, vertical_spacing=0.06)
    for row, (signal, name, colour) in enumerate(_named(signal_1, signal_2), start=1):
        figure.add_trace(_line(np.arange(signal.size) / sampling_rate, signal, name, colour), row=row, col=1)
    laid_out(figure, 320, {}, {}, **LEGEND_LAYOUT)
    return figure.update_xaxes(title="seconds", row=2, col=1)


def aligned(signal_1: Vector, signal_2: Vector, lag: int, sampling_rate: float) -> go.Figure:
    """Return both recordings on one plot, the second moved back by its lag (Fig. 1.5a of the report)."""
    lines = [
        _line((np.arange(signal.size) + offset) / sampling_rate, _standardised(signal), name, colour)
        for offset, (signal, name, colour) in zip((0, -lag), _named(signal_1, signal_2), strict=True)
    ]
    figure = go.Figure(lines).update_traces(opacity=0.75)
    return laid_out(figure, 300, CLOCK_TITLE, "standard deviations", **LEGEND_LAYOUT)


def highest_energy_start(signal_1: Vector, shared: slice) -> int:
    """Return the start of the close-up with the most energy, within the overlap of both recordings."""
    energy = np.concatenate(([0.0], np.cumsum(_standardised(signal_1[shared]) ** 2)))
    length = min(CLOSE_UP_SAMPLES, shared.stop - shared.start)
    return int(shared.start) + int(np.argmax(energy[length:] - energy[:-length]))


def close_up(signal_1: Vector, signal_2: Vector, lag: int, start: int) -> go.Figure:
    """Return 200 samples of both recordings, the second moved back by its lag (Fig. 1.5b of the report)."""
    shared, _ = overlap_slices(signal_1.size, signal_2.size, lag)
    start = min(max(start, shared.start), shared.stop)
    stop = min(start + CLOSE_UP_SAMPLES, shared.stop)
    samples = np.arange(start, stop, dtype=np.int32)
    first, second = _standardised(signal_1)[start:stop], _standardised(signal_2)[start + lag : stop + lag]
    # A broad line under a narrow one, so that both are visible where they coincide.
    lines = [
        go.Scatter(x=samples, y=signal.astype(np.float32), name=name, mode="lines", line=line)
        for signal, name, line in (
            (first, "sensor 1", {"color": SENSOR_1, "width": 7}),
            (second, "sensor 2, shifted to line up", {"color": SENSOR_2, "width": 2}),
        )
    ]
    x = {"title": "sample of sensor 1", "tickformat": ",d"}
    return laid_out(go.Figure(lines), 300, x, "standard deviations", **LEGEND_LAYOUT)


def correlation_curve(result: SignalLag, title: str, *, sizes: tuple[int, int] | None = None) -> go.Figure:
    """Return the correlation curve with its peak and its rivals marked; for "sampled", the votes.

    Parameters
    ----------
    result
        Result of :func:`stereolag.signals.signal_lag`. A grey ribbon spans the range of chance.
    title
        Title of the axis.
    sizes
        Lengths of the recordings, to convert a curve weighted by overlap to plain Pearson correlation; the ribbon then
        widens as the overlap shrinks.
    """
    figure = go.Figure()
    colour = PEAK if result.verdict == "sure" else DOUBTFUL_COLOUR
    marks: list[go.Scatter] = []
    if result.lags is not None and result.correlation is not None:
        # The weights of the curve, with which short overlaps cannot win.
        weight = (
            np.ones(result.lags.size) if sizes is None else np.sqrt(overlap_length(*sizes, result.lags) / min(sizes))
        )
        curve = result.correlation / weight
        _add_ribbon(figure, result, weight)
        marks = _marks(result, curve)
        peak = int(np.searchsorted(result.lags, result.lag))
        shown = np.searchsorted(result.lags, [lag for mark in marks for lag in mark.x])
        around = range(max(0, peak - FULL_DETAIL_LAGS), min(peak + FULL_DETAIL_LAGS + 1, curve.size))
        figure.add_trace(_line(result.lags, curve, title, CORRELATION, [*shown.tolist(), *around]))
        height = float(curve[peak])
        first, last = result.lags[[0, -1]].tolist()
        if sizes is not None:
            figure.update_yaxes(range=[-1.08, 1.08])
    else:
        height, first, last = _add_votes(figure, result.votes or {}, title)
    over_time, label = result.over_time, f"  {result.lag:,}  "
    if over_time is not None and over_time.changes:
        low, high = round(over_time.lowest), round(over_time.highest)
        figure.add_vrect(x0=low, x1=high, fillcolor=PEAK, opacity=0.2, line={"color": PEAK, "width": 1})
        # Above the curve, which may hide the ring.
        above = {"x": (low + high) / 2, "y": 1, "yref": "paper", "yanchor": "bottom", "showarrow": False}
        figure.add_annotation(above, text=typeset(f"{low:,} to {high:,}"), font={"color": PEAK, "size": 14})
        label = ""
    figure.add_traces(marks)
    figure.add_trace(
        rings(
            [result.lag],
            [height],
            colour,
            11,
            2.5,
            text=[typeset(label)],
            textposition="middle left" if result.lag > first + LABEL_LEFT_SHARE * (last - first) else "middle right",
            textfont={"color": colour, "size": 14},
            name="peak",
            hovertemplate="lag %{x}: %{y}<extra>peak</extra>",
        )
    )
    x = {"title": "lag, samples (right: 2 hears it later)", "tickformat": ",d"}
    laid_out(figure, 300, x, {"title": title, "hoverformat": ",.3~f"}, **NO_LEGEND_LAYOUT)
    return figure if label else figure.update_layout(margin_t=LABEL_MARGIN_PX)


def _add_votes(figure: go.Figure, votes: Mapping[int, int], title: str) -> tuple[float, int, int]:
    """Add bars of the most frequent votes; return the largest number of votes, and the first and the last lag shown."""
    lags, counts = np.array(list(votes.items())[:VOTES_SHOWN], dtype=np.int32).T
    first, last = int(lags.min()), int(lags.max())
    bar_width = max(1.0, (last - first) / VOTES_SHOWN)
    figure.add_trace(go.Bar(x=lags, y=counts, width=bar_width, name=title, marker={"color": CORRELATION}))
    height, margin = float(counts[0]), max(0.02 * (last - first), 20.0)
    figure.update_xaxes(range=[first - margin, last + margin])
    figure.update_yaxes(range=[0, 1.1 * height], tickformat=",d", dtick=1 if height < 6 else None)
    return height, first, last


def _marks(result: SignalLag, curve: Vector) -> list[go.Scatter]:
    """Return rings around the other points of the curve that the verdict mentions."""
    changes = result.over_time is not None and result.over_time.changes
    opposite = result.judgement.opposite_lag
    named = (result.lag, *result.rivals)
    arrivals = [round(one.lag) for one in result.arrivals if all(abs(one.lag - lag) > 1 for lag in named)]
    kinds: list[tuple[Sequence[int], str, str]] = [
        (result.rivals, DOUBTFUL_COLOUR, "fits as well"),
        ([] if changes else arrivals, CORRELATION, "another arrival"),
        ([] if opposite is None else [opposite], PEAK, "opposite sign"),
    ]
    assert result.lags is not None
    marks = []
    for given, colour, name in kinds:
        lags = np.array(given, dtype=np.int32)
        lags = lags[np.isin(lags, result.lags)]
        if lags.size:
            heights = curve[np.searchsorted(result.lags, lags)].astype(np.float32)
            more: dict[str, Any] = {"name": name, "hovertemplate": f"lag %{{x}}: %{{y}}<extra>{name}</extra>"}
            if lags[0] == opposite:
                more |= {"text": [typeset(f"  {opposite:,}")], "textposition": "middle right"}
                more["textfont"] = {"color": colour, "size": 14}
            marks.append(rings(lags, heights, colour, 9, 2, **more))
    return marks


MAX_AGREEMENT = 100
"""End of the scale of the agreement, standard deviations; it is logarithmic and begins at 1."""


def agreement_on_scale(judgement: LagJudgement) -> list[float]:
    """Return the positions of chance, needed evidence and evidence on the scale of the agreement, 0..1."""
    levels = np.clip([judgement.chance, judgement.needed, judgement.evidence], 1, MAX_AGREEMENT)
    return [float(one) for one in np.log(levels) / np.log(MAX_AGREEMENT)]


def band_of_chance(result: SignalLag) -> tuple[float, float] | None:
    """Return the values between which a curve due to chance lies; None if they are not known.

    They follow from the curve's own spread. It does not measure chance where it is due to many equal peaks, as for a
    tone, nor where a few loud events without relation rise far above it.
    """
    band = result.judgement.ribbon
    if band is None or result.lags is None or result.correlation is None:
        return None
    if result.verdict == "nothing" and result.judgement.height > result.judgement.needed:
        return None
    peaks = result.correlation[np.searchsorted(result.lags, (result.lag, *result.rivals))]
    return None if result.verdict == "ambiguous" and peaks.min() < 2 * band[1] else band


def _add_ribbon(figure: go.Figure, result: SignalLag, weight: Vector) -> None:
    """Add the ribbon that spans the range of chance."""
    band = band_of_chance(result)
    if band is None or result.lags is None:
        return
    kept = np.unique(np.linspace(0, result.lags.size - 1, RIBBON_POINTS).astype(np.int64))
    lags = result.lags[kept].astype(np.int32)
    lower, upper = (np.clip(level / weight[kept], -1, 1).astype(np.float32) for level in band)
    figure.add_trace(
        go.Scatter(
            x=np.concatenate((lags, lags[::-1])),
            y=np.concatenate((upper, lower[::-1])),
            mode="lines",
            line={"width": 0},
            fill="toself",
            fillcolor="rgba(128, 128, 128, 0.22)",
            hoverinfo="skip",
            name="chance",
        )
    )


def lag_over_time(over_time: LagOverTime, sampling_rate: float) -> go.Figure:
    """Return the lag of each block over the time of recording 1, with a fitted line for each stretch between steps."""
    ends = [(one, place) for one in over_time.stretches for place in (one.begin, one.end)]
    lags = np.array([one.lag_at(place) for one, place in ends])
    seconds = np.array([place for _, place in ends]) / sampling_rate
    line = {"color": CORRELATION, "width": 2}
    lines = go.Scatter(x=seconds, y=lags, mode="lines", line=line, name="line", hoverinfo="skip")
    places, measured = np.array(over_time.places) / sampling_rate, np.array(over_time.lags)
    blocks = go.Scatter(
        x=places,
        y=measured,
        mode="markers",
        marker={"color": PEAK, "size": 7},
        name="blocks",
        hovertemplate="%{x:,.1f} s: %{y:,.2f} samples<extra></extra>",
    )
    # At least one sample high: variation by hundredths must not look like drift.
    every = np.concatenate((lags, measured))
    middle, half = float(every.max() + every.min()) / 2, max(0.5, 0.6 * float(np.ptp(every)))
    y = {"title": "lag, samples", "tickformat": ",.6~f", "range": [middle - half, middle + half]}
    return laid_out(go.Figure([lines, blocks]), 300, CLOCK_TITLE, y, **NO_LEGEND_LAYOUT)


def run_times(seconds: Vector) -> go.Figure:
    """Return a histogram of run times, with their median (Fig. 1.5c of the report)."""
    milliseconds = 1e3 * seconds
    figure = go.Figure(go.Histogram(x=milliseconds, nbinsx=30, marker={"color": CORRELATION}, name="runs"))
    figure.add_vline(x=float(np.median(milliseconds)), line={"color": PEAK, "width": 2, "dash": "dash"})
    return laid_out(figure, 220, "ms", "runs", **NO_LEGEND_LAYOUT)


def _named(signal_1: Vector, signal_2: Vector) -> tuple[tuple[Vector, str, str], tuple[Vector, str, str]]:
    return (signal_1, "sensor 1", SENSOR_1), (signal_2, "sensor 2", SENSOR_2)


def _line(x: npt.NDArray[Any], y: Vector, name: str, colour: str, marked: Sequence[int] = ()) -> go.Scatter:
    """Return a line of about `MAX_POINTS` points that looks like the full one and includes the indices `marked`."""
    if y.size > MAX_POINTS:
        kept = MinMaxDownsampler().downsample(np.ascontiguousarray(y), n_out=MAX_POINTS - 2)  # type: ignore[no-untyped-call]
        kept = np.array(sorted({0, y.size - 1, *kept.tolist(), *marked}))
        x, y = x[kept], y[kept]
    small = np.int32 if np.issubdtype(x.dtype, np.integer) else np.float32
    return go.Scatter(
        x=x.astype(small), y=y.astype(np.float32), name=name, mode="lines", line={"width": 1, "color": colour}
    )


def _standardised(signal: Vector) -> Vector:
    """Return the signal with zero mean, in standard deviations, so that sensors of different gain are comparable."""
    centred = signal - signal.mean()
    return np.asarray(centred / (centred.std() or 1.0))
