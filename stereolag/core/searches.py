"""Settings of a lag and of a template search, declared once for controls, flags, validation and JSON."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, TypeAlias

from pydantic import Field

from stereolag.core.settings import Applies, Settings

SignalMethod: TypeAlias = Literal["fft", "phat", "sampled", "direct"]
TemplateMethod: TypeAlias = Literal["fft", "sampled", "direct"]


class LagSearch(Settings):
    """Settings of :func:`stereolag.signals.signal_lag`."""

    title: ClassVar[str] = "The search for a lag"

    method: SignalMethod = Field(default="fft", title="Method", description="How the lag is looked for.")
    sampling_rate: float = Field(
        default=44_100.0,
        title="Sampling rate, Hz",
        description="Samples per second of both recordings.",
        gt=0,
        allow_inf_nan=False,
    )
    speed: float = Field(
        default=333.0,
        title="Speed of the wave, m/s",
        description="How fast the wave travels, m/s; the report takes 333 for sound.",
        gt=0,
        allow_inf_nan=False,
    )
    max_lag: int | None = Field(
        default=None,
        title="Largest lag, samples",
        description="How far to search to either side, samples; every lag unless set.",
        ge=0,
    )


Range: TypeAlias = tuple[float, float]

RESIZABLE = Applies(lambda query: query.method == "fft", "needs method 'fft'")


class TemplateQuery(Settings):
    """Settings of :func:`stereolag.templates.match_template`; `arguments` converts them."""

    title: ClassVar[str] = "The search for a template"

    method: TemplateMethod = Field(default="fft", title="Method", description="How the template is looked for.")
    min_score: float = Field(
        default=0.5,
        title="Minimum score",
        description="Places that score lower are not matches: 1 is an exact copy, 0 has nothing in common.",
        ge=0,
        le=1,
        json_schema_extra={"step": 0.05},
    )
    max_matches: int = Field(default=1, title="Matches wanted", description="Largest number of copies to find.", ge=1)
    min_scale: Annotated[float, RESIZABLE] = Field(
        default=1.0,
        title="Smallest size",
        description="How small the template may be in the image: 0.7 is seven tenths of its size.",
        ge=0.3,
        le=1,
        json_schema_extra={"step": 0.05},
    )
    max_scale: Annotated[float, RESIZABLE] = Field(
        default=1.0,
        title="Largest size",
        description="How large the template may be in the image: 1.4 is 1.4 times its size.",
        ge=1,
        le=3,
        json_schema_extra={"step": 0.05},
    )
    max_rotation: Annotated[float, RESIZABLE] = Field(
        default=0.0,
        title="Turned by up to, °",
        description="How far the template may be turned in the image, to either side, degrees.",
        ge=0,
        le=180,
        json_schema_extra={"step": 5},
    )

    @property
    def resized(self) -> bool:
        """Whether sizes or angles other than the template's own are searched."""
        return self.min_scale < 1 or self.max_scale > 1 or self.max_rotation > 0

    @property
    def arguments(self) -> dict[str, Any]:
        """The arguments of the search."""
        return {
            "method": self.method,
            "min_score": self.min_score,
            "max_matches": self.max_matches,
            "scales": (self.min_scale, self.max_scale) if self.min_scale < 1 or self.max_scale > 1 else None,
            "rotations": (-self.max_rotation, self.max_rotation) if self.max_rotation else None,
        }
