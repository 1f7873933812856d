"""What can be set for a lag and for a template search, declared once for controls, flags, checks and JSON."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import Field

from stereolag.settings import Settings

SignalMethod: TypeAlias = Literal["fft", "phat", "sampled", "direct"]
TemplateMethod: TypeAlias = Literal["fft", "sampled", "direct"]


class LagSearch(Settings):
    """What :func:`stereolag.signals.signal_lag` is called with."""

    method: SignalMethod = Field(default="fft", title="Method", description="How the lag is looked for.")
    sampling_rate: float = Field(
        default=44_100.0,
        title="Sampling rate, Hz",
        description="Samples a second, of both recordings.",
        gt=0,
        allow_inf_nan=False,
    )
    speed: float = Field(
        default=333.0,
        title="Speed of the wave, m/s",
        description="How fast the wave travels, m/s; sound in the report 333.",
        gt=0,
        allow_inf_nan=False,
    )
    max_lag: int | None = Field(
        default=None,
        title="Largest lag, samples",
        description="How far to search to either side, samples; every lag unless set.",
        ge=0,
    )


class TemplateQuery(Settings):
    """What :func:`stereolag.templates.match_template` is called with."""

    method: TemplateMethod = Field(default="fft", title="Method", description="How the template is looked for.")
    min_score: float = Field(
        default=0.5,
        title="Minimum score",
        description="Places that score lower are no match: 1 is an exact copy, 0 has nothing in common.",
        ge=0,
        le=1,
        json_schema_extra={"step": 0.05},
    )
    max_matches: int = Field(
        default=1, title="Matches wanted", description="At most so many places are given.", ge=1, le=20
    )
