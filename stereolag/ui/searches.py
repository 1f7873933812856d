"""What can be set for a lag and for a template search, declared once for controls, checks and JSON."""

from __future__ import annotations

from pydantic import Field

from stereolag.settings import Settings
from stereolag.signals import SignalMethod
from stereolag.templates import TemplateMethod


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


class TemplateQuery(Settings):
    """What :func:`stereolag.templates.match_template` is called with."""

    method: TemplateMethod = Field(default="fft", title="Method")
    min_score: float = Field(
        default=0.5,
        title="Minimum score",
        description="Places that score lower are no match: 1 is an exact copy, 0 has nothing in common.",
        ge=0,
        le=1,
        json_schema_extra={"step": 0.05},
    )
    max_matches: int = Field(
        default=1, title="Matches wanted", description="At most so many places are framed.", ge=1, le=20
    )


LAG_METHODS = {"fft": "FFT", "phat": "GCC-PHAT", "sampled": "Sampled", "direct": "Direct"}

LAG_METHODS_EXPLAINED = {
    "fft": "Every lag at once: a fast Fourier transform turns the sliding and multiplying into one product. "
    "The method of choice.",
    "phat": "Like FFT, but every pitch counts the same: a needle-sharp peak, also in rooms that echo; "
    "loud noise hurts it more.",
    "sampled": "The report’s Appendix A: pick samples at random, look them up in the other recording, and let each "
    "vote for a lag. Sure while the noise stays well below the sound.",
    "direct": "Slide by one sample, multiply, add up; again for every lag. Slow, and simple enough to trust.",
}

CURVES = {
    "fft": "correlation × √overlap",
    "phat": "phase correlation",
    "sampled": "votes",
    "direct": "correlation × √overlap",
}
"""What the curve of each method counts."""

TEMPLATE_METHODS = {"fft": "FFT", "sampled": "Sampled", "direct": "Direct"}

TEMPLATE_METHODS_EXPLAINED = {
    "fft": "Scores every place at once through a fast Fourier transform. Finds him dulled and half hidden too.",
    "sampled": "The report’s Appendix B: look for one rare pixel of the template and score only where the image has "
    "it. Very fast, and blind where not a single pixel is left as it was.",
    "direct": "Slides the template over the image pixel by pixel. The same scores as FFT, in minutes: "
    "to compare, not to wait for.",
}
