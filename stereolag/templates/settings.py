"""What can be set for a template search, declared once for controls, flags, checks and JSON."""

from __future__ import annotations

from pydantic import Field

from stereolag.settings import Settings
from stereolag.templates.score_maps import TemplateMethod


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
