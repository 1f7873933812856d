"""Recordings and their correlation as Plotly figures."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import plotly.graph_objects as go
from plotly.subplots import make_subplots
from tsdownsample import MinMaxLTTBDownsampler

from stereolag.arrays import Vector
from stereolag.figures.pictures import CORRELATION, PEAK, SENSOR_1, SENSOR_2
from stereolag.signals import SignalLag

POINTS = 2_000
"""Drawn for a line, however long: about two for every pixel of its width."""

CLOSE_UP_SAMPLES = 200
"""Of Fig. 1.5b of the report."""

VOTES_SHOWN = 200

LINE = {"width": 1}
LAYOUT: dict[str, Any] = {
    "margin": {"l": 8, "r": 8, "t": 8, "b": 8},
    "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
    "hovermode": "x unified",
}


def waveforms(signal_1: Vector, signal_2: Vector, sampling_rate: float) -> go.Figure:
    """Return both recordings as they were made, one above the other, over the same seconds."""
    figure = make_subplots(rows=2, shared_xaxes=True, vertical_spacing=0.06)
    for row, (signal, name, colour) in enumerate(_named(signal_1, signal_2), start=1):
        seconds = np.arange(signal.size) / sampling_rate
        figure.add_trace(_line(seconds, signal, name, colour), row=row, col=1)
    figure.update_layout(height=320, **LAYOUT)
    figure.update_xaxes(title="seconds", row=2, col=1)
    return figure


def aligned(signal_1: Vector, signal_2: Vector, lag: int, sampling_rate: float) -> go.Figure:
    """Return both recordings on one plot, the second moved back by its lag (Fig. 1.5a of the report)."""
    figure = go.Figure()
    offsets = (0, -lag)
    for offset, (signal, name, colour) in zip(offsets, _named(signal_1, signal_2), strict=True):
        seconds = (np.arange(signal.size) + offset) / sampling_rate
        trace = _line(seconds, _standardised(signal), name, colour)
        figure.add_trace(trace.update(opacity=0.75))
    figure.update_layout(height=300, **LAYOUT)
    figure.update_xaxes(title="seconds on the clock of sensor 1")
    figure.update_yaxes(title="standard deviations")
    return figure


def shared_samples(signal_1: Vector, signal_2: Vector, lag: int) -> tuple[int, int]:
    """Return the first sample of `signal_1` that `signal_2` holds too, and the one after the last."""
    return max(0, -lag), min(signal_1.size, signal_2.size - lag)


def liveliest_start(signal_1: Vector, first: int, last: int) -> int:
    """Return where, between two samples, the close-up with the most energy begins."""
    energy = np.concatenate(([0.0], np.cumsum(_standardised(signal_1[first:last]) ** 2)))
    length = min(CLOSE_UP_SAMPLES, last - first)
    return first + int(np.argmax(energy[length:] - energy[:-length]))


def close_up(signal_1: Vector, signal_2: Vector, lag: int, start: int) -> go.Figure:
    """Return 200 samples of both recordings, the second moved back by its lag (Fig. 1.5b of the report)."""
    first, last = shared_samples(signal_1, signal_2, lag)
    start = min(max(start, first), last)
    stop = min(start + CLOSE_UP_SAMPLES, last)
    samples = np.arange(start, stop, dtype=np.int32)
    shown = (_standardised(signal_1)[start:stop], _standardised(signal_2)[start + lag : stop + lag])
    figure = go.Figure()
    # A broad line under a narrow one: both are seen where they coincide.
    for signal, name, colour, width in zip(
        shown, ("sensor 1", "sensor 2, shifted to line up"), (SENSOR_1, SENSOR_2), (7, 2), strict=True
    ):
        line = {"color": colour, "width": width}
        figure.add_trace(go.Scatter(x=samples, y=signal.astype(np.float32), name=name, mode="lines", line=line))
    figure.update_layout(height=300, **LAYOUT)
    figure.update_xaxes(title="sample of sensor 1", tickformat=",d")
    figure.update_yaxes(title="standard deviations")
    return figure


def correlation_curve(result: SignalLag, title: str) -> go.Figure:
    """Return the curve of a result with its peak marked, over an axis titled `title`; for "sampled", the votes."""
    figure = go.Figure()
    if result.lags is not None and result.correlation is not None:
        figure.add_trace(_line(result.lags, result.correlation, title, CORRELATION))
        height = float(result.correlation[int(np.searchsorted(result.lags, result.lag))])
    else:
        votes = dict(list((result.votes or {}).items())[:VOTES_SHOWN])
        lags, counts = np.array(list(votes), dtype=np.int32), np.array(list(votes.values()), dtype=np.int32)
        bar_width = max(1.0, float(np.ptp(lags)) / VOTES_SHOWN)
        figure.add_trace(go.Bar(x=lags, y=counts, width=bar_width, name=title, marker={"color": CORRELATION}))
        height = float(counts[0])
    figure.add_trace(_peak(result.lag, height))
    figure.update_layout(height=300, **LAYOUT | {"hovermode": "closest", "showlegend": False})
    figure.update_xaxes(title="lag, samples (right: sensor 2 hears it later)", tickformat=",d")
    figure.update_yaxes(title=title)
    return figure


def _named(signal_1: Vector, signal_2: Vector) -> tuple[tuple[Vector, str, str], tuple[Vector, str, str]]:
    return (signal_1, "sensor 1", SENSOR_1), (signal_2, "sensor 2", SENSOR_2)


def _line(x: npt.NDArray[Any], y: Vector, name: str, colour: str) -> go.Scatter:
    """Return a line of at most `POINTS` points that looks as the whole would."""
    if y.size > POINTS:
        kept = MinMaxLTTBDownsampler().downsample(np.ascontiguousarray(y), n_out=POINTS)  # type: ignore[no-untyped-call]
        x, y = x[kept], y[kept]
    small = np.int32 if np.issubdtype(x.dtype, np.integer) else np.float32
    return go.Scatter(x=x.astype(small), y=y.astype(np.float32), name=name, mode="lines", line=LINE | {"color": colour})


def _peak(lag: int, height: float) -> go.Scatter:
    return go.Scatter(
        x=[lag],
        y=[height],
        mode="markers+text",
        marker={"color": PEAK, "size": 11, "symbol": "circle-open", "line": {"width": 2.5}},
        text=[f"  {lag:,}"],
        textposition="middle right",
        textfont={"color": PEAK, "size": 14},
        cliponaxis=False,
        name="peak",
        hovertemplate="lag %{x:,}: %{y:.3f}<extra>peak</extra>",
    )


def _standardised(signal: Vector) -> Vector:
    """Return the signal without its mean and in standard deviations: sensors of different gain become comparable."""
    centred = signal - signal.mean()
    return np.asarray(centred / (centred.std() or 1.0))
