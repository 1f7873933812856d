"""Settings of the matching cost: how badly each pixel of the left image fits the right image at each lag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field, model_validator

from stereolag.core.settings import Applies, Settings, marker

MOST = 250
"""Largest sum of the weights: a volume stores costs in 8 bits."""


@dataclass(frozen=True)
class TermWeight:
    """Marker for the weight of a term: its highest cost."""


class MatchingCost(Settings):
    """Cost of a mismatch: window correlation plus finer terms that keep edges sharp."""

    correlation: Annotated[int, TermWeight()] = Field(
        default=100,
        title="Correlation",
        description="Cost of windows that are each other's negative (ZNCC -1); +1 costs nothing.",
        ge=0,
        le=100,
    )
    census: Annotated[int, TermWeight()] = Field(
        default=100,
        title="Census",
        description="Cost where all of the 5 × 5 neighbours have changed from darker to brighter or back.",
        ge=0,
        le=100,
    )
    gradient: Annotated[int, TermWeight()] = Field(
        default=40,
        title="Gradient",
        description="Cost of a horizontal gradient that differs by the limit or more.",
        ge=0,
        le=50,
    )
    gradient_limit: Annotated[int, Applies(lambda settings: settings.gradient > 0, "needs gradient above 0")] = Field(
        default=8,
        title="Gradient limit",
        description="Difference of gradients, grey levels of 255, above which the cost no longer rises.",
        ge=1,
        le=64,
    )

    @model_validator(mode="after")
    def _highest_is_allowed(self) -> MatchingCost:
        if not 0 < self.highest <= MOST:
            *names, last = self.weights()
            raise ValueError(
                f"{', '.join(names)} and {last} add up to {self.highest}; allowed are 1 to {MOST} together."
            )
        return self

    @property
    def highest(self) -> int:
        """Return the cost of a lag at which nothing fits, at most :data:`MOST`."""
        return sum(getattr(self, name) for name in self.weights())

    @classmethod
    def weights(cls) -> list[str]:
        """Return the names of the weights, one per term."""
        return [name for name, field in cls.model_fields.items() if marker(field, TermWeight)]
