"""What can be set for a lag, declared once for controls, flags, checks and JSON."""

from __future__ import annotations

from pydantic import Field

from stereolag.settings import Settings
from stereolag.signals.curves import SignalMethod


class LagSearch(Settings):
    """What :func:`stereolag.signals.signal_lag` is called with."""

    method: SignalMethod = Field(default="fft", title="Method")
    sampling_rate: float = Field(
        default=44_100.0, title="Sampling rate, Hz", description="Samples a second, of both recordings.", gt=0
    )
    speed: float = Field(
        default=333.0, title="Speed of the wave, m/s", description="Of sound in the report: 333 m/s.", gt=0
    )
    max_lag: int | None = Field(
        default=None,
        title="Largest lag, samples",
        description="How far to search to either side; leave it empty to search every lag.",
        ge=0,
    )
