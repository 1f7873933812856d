"""The frames of the sequence command and their calibration, combined as for a pair."""

from __future__ import annotations

import argparse
from typing import NamedTuple

from stereolag.commands.fitting import fitted
from stereolag.commands.parsing import read
from stereolag.geometry.calibration import Calibration
from stereolag.io.calibrations import read_calibration
from stereolag.sequences import RectifiedSequence, StereoSequence, open_sequence


class Drive(NamedTuple):
    """Frames ready for matching, with their calibration.

    Attributes
    ----------
    sequence
        The frames.
    calibration
        Calibration of the rectified frames at their size; None if unknown.
    said
        Sentences about the processing of the frames.
    """

    sequence: StereoSequence
    calibration: Calibration | None = None
    said: tuple[str, ...] = ()


def read_drive(options: argparse.Namespace) -> Drive:
    """Return the sequence named by the arguments; its first readable frame shows whether it is raw.

    Raises
    ------
    ValueError
        Files that are refused, or that do not belong together.
    OSError
        Files that cannot be opened.
    """
    sequence = open_sequence(options.left, options.right, truth=options.truth, frame_rate=options.frame_rate)
    if options.calibration is None:
        return Drive(sequence)
    calibration = read(read_calibration, *options.calibration)
    first = sequence.first_readable()
    if first is None:
        raise ValueError(f"None of the {len(sequence):,} frames can be read: there is nothing to calibrate.")
    found = fitted(calibration, first.left, first.right, options.rectify)
    if found.straight is None:
        said = (f"The frames are rectified already ({found.rows}).",) if found.rows else ()
        return Drive(sequence, found.calibration, said)
    if options.truth is not None:
        raise ValueError(
            f"The frames are raw ({found.rows}) and the ground truth belongs to them before rectification: leave out "
            "--truth or --calibration, or give --rectify no."
        )
    said = (f"The frames are rectified with their calibration ({found.rows}).",)
    return Drive(RectifiedSequence(sequence, calibration), found.calibration, said)
