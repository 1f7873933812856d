"""Semi-global optimisation: a smooth surface at the least cost, along straight paths from eight sides."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from stereolag.kernels.semi_global import Costs, Sums, path_sums
from stereolag.progress import Progress, silent
from stereolag.settings import Settings


class SemiGlobal(Settings):
    """What a change of disparity between neighbours costs; a mismatch costs up to 250."""

    penalty_small: int = Field(
        default=24,
        title="Penalty of a slant",
        description="Cost of a change by one lag. Higher is smoother, lower follows slanted surfaces.",
        ge=1,
        le=250,
    )
    penalty_large: int = Field(
        default=400,
        title="Penalty of a jump",
        description="Cost of any larger change, where the picture is even.",
        ge=1,
        le=3000,
        json_schema_extra={"step": 20},
    )
    penalty_at_edges: int = Field(
        default=80,
        title="Penalty of a jump at an edge",
        description="What is left of that cost across a strong edge of the picture, where surfaces may end.",
        ge=1,
        le=3000,
        json_schema_extra={"step": 20},
    )
    edge_contrast: int = Field(
        default=40,
        title="Strong edge",
        description="Step between two pixels, grey levels of 255, that counts as a strong edge.",
        ge=1,
        le=255,
    )

    @model_validator(mode="after")
    def _in_order(self) -> SemiGlobal:
        if not self.penalty_small <= self.penalty_at_edges <= self.penalty_large:
            raise ValueError(
                f"penalty_small is {self.penalty_small}, penalty_at_edges {self.penalty_at_edges} and penalty_large "
                f"{self.penalty_large}; each must be at least as large as the one before."
            )
        return self


def optimise(
    costs: Costs, guide: npt.NDArray[np.uint8], settings: SemiGlobal, progress: Progress = silent
) -> tuple[Sums, Sums]:
    """Return the costs of the best paths from eight sides, summed over four and four of them.

    H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", 2008. The penalty of a jump
    falls in a straight line with the step of grey level that the path crosses.

    Parameters
    ----------
    costs
        (H, W, D) uint8 matching cost, at most 250.
    guide
        (H, W) uint8, the left image.
    settings
        The penalties.
    progress
        Called with the fraction done.

    Returns
    -------
    tuple of ndarray
        Two (H, W, D) uint16 volumes; the disparity of a pixel is where their sum is least.
    """
    fall = np.linspace(settings.penalty_large, settings.penalty_at_edges, settings.edge_contrast + 1)
    large = np.full(256, settings.penalty_at_edges, np.uint16)
    large[: fall.size] = np.rint(fall)
    return path_sums(costs, guide, settings.penalty_small, large, progress)
