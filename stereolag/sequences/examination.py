"""The input doctor on a drive: a few frames spread over it, and the frames of both cameras that belong together."""

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

EXAMINED = 3
"""Frames that are examined, evenly spread."""

FARTHEST = 5
"""Most frames by which one camera may be late."""


def diagnose_sequence(sequence: StereoSequence) -> Diagnosis | None:
    """Return the findings on a drive: those of most of the frames examined, and the range that all of them need.

    Parameters
    ----------
    sequence
        The frames; damaged ones are left out.

    Returns
    -------
    Diagnosis
        As for one pair. NOT_SAME_MOMENT also has ``frames``, if another pairing has rows that match: the right picture
        so many frames later belongs to each left one. None if none of the frames can be read.
    """
    places = np.unique(np.linspace(0, len(sequence) - 1, min(EXAMINED, len(sequence))).round().astype(int)).tolist()
    pictures = {place: found for place in places if (found := _pictures(sequence, place)) is not None}
    if not pictures:
        first = sequence.first_readable()
        return None if first is None else diagnose(*first.turned(sequence.turn))
    every = [diagnose(*both) for both in pictures.values()]
    findings = [_usual(code, every) for code in FindingCode if code != FindingCode.RANGE]
    kept = tuple(finding for finding in findings if finding is not None)
    moment = next((one for one in kept if one.code == FindingCode.NOT_SAME_MOMENT and not one.healthy), None)
    if moment is not None and (late := _frames_late(sequence, [*pictures])):
        timed = replace(moment, numbers={**moment.numbers, "frames": late})
        kept = tuple(timed if one is moment else one for one in kept)
    seen = [one.disparities for one in every if one.disparities is not None]
    if not seen:
        return Diagnosis(kept, None, None)
    ends = min(low for low, _ in seen), max(high for _, high in seen)
    repeats = float(np.median([one.repeats_px for one in every]))
    width = next(iter(pictures.values()))[0].shape[1]
    return Diagnosis(kept, ends, range_for(*ends, width, repeats), repeats)


def _pictures(sequence: StereoSequence, place: int) -> tuple[Image, Image] | None:
    """Return the pictures of a frame; None if it is damaged, or its pictures are of two sizes."""
    frame = sequence.readable(place)
    if frame is None or frame.left.shape[:2] != frame.right.shape[:2]:
        return None
    return frame.turned(sequence.turn)


def _usual(code: FindingCode, every: list[Diagnosis]) -> Finding | None:
    """Return the finding of most frames on one question; None if none could be judged."""
    found = [finding for one in every if (finding := one.finding(code)) is not None]
    ill = [finding for finding in found if not finding.healthy]
    if 2 * len(ill) > len(every):
        return ill[0]
    return next((finding for finding in found if finding.healthy), None)


def _frames_late(sequence: StereoSequence, places: list[int]) -> int:
    """Return by how many frames the right pictures are late, if another pairing has rows that match; otherwise 0."""
    scores = {}
    for late in range(-FARTHEST, FARTHEST + 1):
        known = [row for place in places if (row := _rows_apart(sequence, place, late)) is not None]
        if 2 * len(known) > len(places):
            scores[late] = float(np.median(known))
    return min(scores, key=lambda late: scores[late], default=0)


def _rows_apart(sequence: StereoSequence, place: int, late: int) -> float | None:
    """Return the scatter of the rows of a left picture and a later right one, px; None if few features agree."""
    if not 0 <= place + late < len(sequence):
        return None
    left, right = _pictures(sequence, place), _pictures(sequence, place + late)
    if left is None or right is None:
        return None
    views = find_views(find_correspondences(left[0], right[1]))
    if views is None or len(views.points) < MIN_MATCHES:
        return None
    return float(np.median(np.abs(views.points.dy)))
