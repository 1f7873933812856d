"""The findings of the input doctor in words, for pages and commands."""

from __future__ import annotations

from collections.abc import Mapping

from stereolag.assess.findings import Finding, FindingCode
from stereolag.core.typography import counted

SENTENCES: Mapping[FindingCode, tuple[str, str]] = {
    FindingCode.MATCHES: (
        "{count:,.0f} features match between the images.",
        "{only} between the images, too few to judge the geometry: do they show the same scene?",
    ),
    FindingCode.IDENTICAL: (
        "The images differ{moved}.",
        "Both images show the same view: nothing moves between them, so there is no depth to measure.",
    ),
    FindingCode.LAYOUT: (
        "Each image shows one view.",
        "The left image holds both views, one {where} the other{squeezed}: give it alone.",
    ),
    FindingCode.MIRRORED: (
        "Both images are the same way round.",
        "The right image is mirrored: {count:,.0f} features match once it is mirrored back.",
    ),
    FindingCode.ABOVE_EACH_OTHER: (
        "The cameras do not stand above each other.",
        "The cameras stand above each other: distance moves points up or down instead of sideways.",
    ),
    FindingCode.ONE_MOVING_CAMERA: (
        "No camera stands in front of the other.",
        "One moving camera may have taken both images: {motion}.",
    ),
    FindingCode.NOT_SAME_MOMENT: (
        "No motion is seen between the images.",
        "The images are not of the same moment: {motion}.{fitting}",
    ),
    FindingCode.SWAPPED: (
        "{left}.",
        "Left and right look swapped: {run}, and they should be positive.",
    ),
    FindingCode.ROWS: (
        "Rows match to {off:.1f} px (spread {spread_px:.1f} px).",
        "The right image sits {off:.1f} px {side} than the left (spread {spread_px:.1f} px): in a rectified pair, rows "
        "match.",
    ),
    FindingCode.ROTATION: (
        "The right image is rotated by {rotation_deg:+.2f}° and scaled by {growth:+.1f} %: close enough.",
        "The right image is rotated by {rotation_deg:+.2f}° and scaled by {growth:+.1f} %: the pair is not rectified.",
    ),
    FindingCode.BENT_ROWS: (
        "Rows do not bend (spread {spread_px:.1f} px, of which {noise_px:.1f} px are noise).",
        "Rows bend: after the best shift, rotation and scale, they are still off by {lowest_px:+.1f} to "
        "{highest_px:+.1f} px (spread {spread_px:.1f} px, of which {noise_px:.1f} px are noise). The lenses distort, "
        "or the cameras are turned. The page “Calibrate” measures both from pictures of a board.{mended}",
    ),
    FindingCode.EXPOSURE: (
        "The right image has {gain:.2f} times the left one’s contrast, offset by {offset:+.0f} grey levels: close "
        "enough.",
        "The right image has {gain:.2f} times the left one’s contrast, offset by {offset:+.0f} grey levels: ZNCC is "
        "unaffected, StereoBM and plain correlation suffer.",
    ),
    FindingCode.TEXTURE: (
        "{flat:.0f} % of the image has hardly any texture.",
        "{flat:.0f} % of the image has hardly any texture: windows cannot be matched there. Larger windows help a "
        "little.",
    ),
    FindingCode.EMPTY_BORDER: (
        "{left:.0f} % of the left and {right:.0f} % of the right image are black borders.",
        "{left:.0f} % of the left and {right:.0f} % of the right image are black borders: nothing was seen there.",
    ),
    FindingCode.RANGE: (
        "The pair needs about {needed}, and {searched} px are searched: a good range.{every}",
        "The pair needs about {needed}, and {searched} px are searched: {fault}.{every}",
    ),
}
"""The sentences for a healthy and an ill finding; the fields are its numbers and what :func:`_words` adds."""


def finding_in_words(finding: Finding) -> str:
    """Return the sentence for a finding, with its numbers."""
    healthy, ill = SENTENCES[finding.code]
    return (healthy if finding.healthy else ill).format(**finding.numbers, **_words(finding))


def _words(finding: Finding) -> dict[str, str | float]:
    """Return the words and percentages of a sentence that are derived from its numbers."""
    numbers = finding.numbers
    match finding.code:
        case FindingCode.MATCHES:
            only = f"Only {numbers['count']:,.0f} features match" if numbers["count"] else "No features match"
            return {"only": only}
        case FindingCode.IDENTICAL:
            moved = f": features move by up to {numbers['moved_px']:.0f} px" if "moved_px" in numbers else ""
            return {"moved": moved}
        case FindingCode.LAYOUT if not finding.healthy:
            where, squeezed = ("beside", "width") if numbers["beside"] else ("above", "height")
            return {"where": where, "squeezed": f", squeezed to half their {squeezed}" if numbers["half"] else ""}
        case FindingCode.ONE_MOVING_CAMERA | FindingCode.NOT_SAME_MOMENT if not finding.healthy:
            if "turned_deg" in numbers:
                only = f"all points move as if it had only turned, by {numbers['turned_deg']:.1f}°"
                return {
                    "motion": f"{only}, which tells nothing of depth. Turned cameras before a flat scene look alike"
                }
            if "moved" in numbers:
                motion = f"{numbers['moved']:.0f} features moved up or down together, off the rows of the others"
            else:
                epipole = f"one place, {100 * numbers['x']:.0f} % across and {100 * numbers['y']:.0f} % down the image"
                one_camera = finding.code is FindingCode.ONE_MOVING_CAMERA
                seen = (
                    "so rows do not match" if one_camera else "as from cameras that move, not as from two side by side"
                )
                motion = f"points move away from {epipole}, {seen}"
            return {"motion": motion, "fitting": _fitting(numbers.get("frames", 0))}
        case FindingCode.SWAPPED:
            run = f"disparities run from {numbers['lowest_px']:.0f} to {numbers['highest_px']:.0f} px"
            unclear = (
                "It is unclear which image is the left one: the pair is not rectified, and its features do not decide"
            )
            return {"run": run, "left": f"Left is left: {run}" if numbers["known"] else unclear}
        case FindingCode.ROWS:
            return {"off": abs(numbers["offset_px"]), "side": "lower" if numbers["offset_px"] > 0 else "higher"}
        case FindingCode.ROTATION:
            return {"growth": 100 * (numbers["scale"] - 1)}
        case FindingCode.BENT_ROWS:
            return {"mended": _mended(numbers) if finding.remedy is not None else ""}
        case FindingCode.TEXTURE:
            return {"flat": 100 * numbers["flat_share"]}
        case FindingCode.EMPTY_BORDER:
            return {"left": 100 * numbers["left_share"], "right": 100 * numbers["right_share"]}
        case FindingCode.RANGE:
            return _of_range(numbers)
    return {}


def _fitting(late: float) -> str:
    """Return a sentence on the frame of the right camera that fits, `late` frames later; "" if it is 0."""
    frames = f"{counted(round(abs(late)), 'frame')} {'later' if late > 0 else 'earlier'}"
    return f" The right picture {frames} fits." if late else ""


def _mended(numbers: Mapping[str, float]) -> str:
    lens = ", with one coefficient for the lenses" if numbers["lens"] else ""
    return f" Rectified from the images alone{lens}, {numbers['rectified_px']:.1f} px remain on unused features."


def _of_range(numbers: Mapping[str, float]) -> dict[str, str | float]:
    low, high, first = numbers["lowest_px"], numbers["highest_px"], numbers["min_disparity"]
    every = (
        f" The picture repeats every {numbers['repeats_px']:.0f} px along its rows: a search that is wider finds every "
        "point more than once."
    )
    return {
        "needed": f"{low:.0f} px" if round(low) == round(high) else f"{low:.0f} to {high:.0f} px",
        "searched": f"{first:.0f} to {first + numbers['num_disparities'] - 1:.0f}",
        "fault": "too small a range" if numbers["missing_px"] > 0 else "far more than needed",
        "every": every if numbers["repeats_px"] else "",
    }
