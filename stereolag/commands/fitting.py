"""A calibration fitted to images: scaled to their size, and used to rectify them if they are raw."""

from __future__ import annotations

from typing import NamedTuple

from stereolag.assess.orientation import row_evidence
from stereolag.commands.pair_flags import AUTO, YES
from stereolag.core.inputs import Image
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import Rectified, calibration_for, rectify


class Fitted(NamedTuple):
    """A calibration that fits a pair.

    Attributes
    ----------
    calibration
        Calibration of the rectified pair at its size.
    straight
        The pair rectified with it; None if it was rectified already.
    rows
        Evidence for that; "" for a calibration without cameras.
    """

    calibration: Calibration
    straight: Rectified | None = None
    rows: str = ""


def fitted(calibration: Calibration, left: Image, right: Image, wanted: str) -> Fitted:
    """Return the calibration for a pair, rectified if it is raw, as decided by its rows or by `wanted`.

    Raises
    ------
    ValueError
        Images of another shape than the calibration's, or rectification wanted without the cameras it needs.
    """
    calibration = calibration_for(calibration, left.shape[1], left.shape[0])
    if calibration.rig is None:
        if wanted == YES:
            raise ValueError("The calibration is of a rectified pair: it holds no cameras to rectify with.")
        return Fitted(calibration)
    straight = rectify(left, right, calibration)
    if wanted == AUTO:
        evidence = row_evidence((left, right), (straight.left, straight.right))
        raw = not evidence.already_rectified
        rows = f"rows differ by {evidence.given_px:.2g} px, rectified by {evidence.rectified_px:.2g} px"
    else:
        raw, rows = wanted == YES, "as you said"
    return Fitted(straight.calibration, straight if raw else None, rows)
