"""The input doctor on a drive: the findings on a few of its frames, and how many frames one camera is late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stereolag.assess.diagnosis import Diagnosis, diagnose
from stereolag.assess.features import MIN_MATCHES
from stereolag.assess.findings import Finding, FindingCode
from stereolag.assess.layout import find_views
from stereolag.assess.orientation import find_correspondences
from stereolag.assess.search_range import range_for
from stereolag.core.inputs import Image
from stereolag.sequences.sources import StereoSequence

EXAMINED_FRAMES = 3
"""Number of frames examined, evenly spread."""

MAX_LATE_FRAMES = 5
"""Largest number of frames by which one camera may be late."""


def diagnose_sequence(sequence: StereoSequence) -> Diagnosis | None:
    """Return the findings on a drive: those on most of the frames examined, and the range that all of these need.

    Parameters
    ----------
    sequence
        The frames; damaged ones are skipped.

    Returns
    -------
    Diagnosis
        As for one pair. NOT_SAME_MOMENT also has ``frames`` if the rows match better when each left picture is paired
        with the right one that many frames later. None if none of the frames can be read.
    """
    places = np.linspace(0, len(sequence) - 1, min(EXAMINED_FRAMES, len(sequence)))
    numbers = np.unique(places.round().astype(int)).tolist()
    pictures = {number: found for number in numbers if (found := _pictures(sequence, number)) is not None}
    if not pictures:
        first = sequence.first_readable()
        return None if first is None else diagnose(*first.turned(sequence.turn))
    diagnoses = [diagnose(*both) for both in pictures.values()]
    by_question = (_majority_finding(code, diagnoses) for code in FindingCode if code != FindingCode.RANGE)
    findings = tuple(filter(None, by_question))
    moment = next((one for one in findings if one.code == FindingCode.NOT_SAME_MOMENT and not one.healthy), None)
    if moment is not None and (late := _frames_late(sequence, [*pictures])):
        timed = replace(moment, numbers={**moment.numbers, "frames": late})
        findings = tuple(timed if one is moment else one for one in findings)
    ranges = [one.disparities for one in diagnoses if one.disparities is not None]
    if not ranges:
        return Diagnosis(findings, None, None)
    ends = min(low for low, _ in ranges), max(high for _, high in ranges)
    repeats = float(np.median([one.repeats_px for one in diagnoses]))
    width = next(iter(pictures.values()))[0].shape[1]
    return Diagnosis(findings, ends, range_for(*ends, width, repeats), repeats)


def _pictures(sequence: StereoSequence, number: int) -> tuple[Image, Image] | None:
    """Return the pictures of a frame; None if it is damaged, or its pictures differ in size."""
    frame = sequence.readable(number)
    return frame.turned(sequence.turn) if frame and frame.left.shape[:2] == frame.right.shape[:2] else None


def _majority_finding(code: FindingCode, diagnoses: list[Diagnosis]) -> Finding | None:
    """Return the finding of most frames on one question; None if no frame has one."""
    findings = [finding for one in diagnoses if (finding := one.finding(code)) is not None]
    problems = [finding for finding in findings if not finding.healthy]
    if 2 * len(problems) > len(diagnoses):
        return problems[0]
    return next((finding for finding in findings if finding.healthy), None)


def _frames_late(sequence: StereoSequence, numbers: list[int]) -> int:
    """Return the number of frames by which the right pictures are late: that with the smallest row errors."""
    errors = {}
    for late in range(-MAX_LATE_FRAMES, MAX_LATE_FRAMES + 1):
        known = [error for number in numbers if (error := _row_error(sequence, number, late)) is not None]
        if 2 * len(known) > len(numbers):
            errors[late] = float(np.median(known))
    return min(errors, key=lambda late: errors[late], default=0)


def _row_error(sequence: StereoSequence, number: int, late: int) -> float | None:
    """Return the median distance in rows between a left picture and a later right one, px; None with few matches."""
    if not 0 <= number + late < len(sequence):
        return None
    left, right = _pictures(sequence, number), _pictures(sequence, number + late)
    views = find_views(find_correspondences(left[0], right[1])) if left and right else None
    return float(np.median(np.abs(views.points.dy))) if views and len(views.points) >= MIN_MATCHES else None
