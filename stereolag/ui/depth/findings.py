"""Sentences for the input doctor's findings and repairs."""

from __future__ import annotations

from stereolag.assess.diagnosis import Finding, FindingCode
from stereolag.assess.remedies import Remedy

DOCTOR_HEALTHY = "**Input doctor:** no problems found."

REMEDIES_DONE = {
    Remedy.SWAP_SIDES: "Left and right were swapped.",
    Remedy.ALIGN_ROWS: "The right image was moved up or down until its rows match the left one’s.",
    Remedy.LEVEL: "The right image was rotated and scaled until its rows match: depth is relative.",
    Remedy.RECTIFY: (
        "Both images were turned until their rows match, and corrected for lens distortion where that helps: depth is "
        "relative."
    ),
    Remedy.MATCH_EXPOSURE: "The right image was given the brightness and contrast of the left one.",
}
TRUTH_DROPPED = {
    Remedy.SWAP_SIDES: "The ground truth belongs to the other image and is left out.",
    Remedy.RECTIFY: "The ground truth belongs to the image before that and is left out.",
}


def problems_in_words(count: int) -> str:
    """Return a sentence with the number of problems found."""
    return f"**Input doctor:** {'one problem' if count == 1 else f'{count} problems'} found on this pair."


def finding_in_words(finding: Finding) -> str:
    """Return the sentence for a finding, with its numbers."""
    return _FINDINGS[finding.code](finding)


def remedy_in_words(finding: Finding) -> str:
    """Return the label of the button that applies the remedy of a finding."""
    match finding.remedy:
        case Remedy.SWAP_SIDES:
            return "Swap left and right"
        case Remedy.ALIGN_ROWS:
            return "Align the rows"
        case Remedy.LEVEL:
            return "Rectify from the images alone (depth becomes relative)"
        case Remedy.RECTIFY:
            return "Rectify both images for now (depth becomes relative)"
        case Remedy.MATCH_EXPOSURE:
            return "Match the brightness"
        case Remedy.SET_RANGE:
            first, count = (finding.numbers[f"suggested_{name}"] for name in ("min_disparity", "num_disparities"))
            return f"Search {count:.0f} disparities from {first:.0f}"
    return ""


def _matches(finding: Finding) -> str:
    count = finding.numbers["count"]
    if finding.healthy:
        return f"{count:,.0f} features match between the images."
    only = f"Only {count:,.0f} features match" if count else "No features match"
    return f"{only} between the images, too few to judge the geometry: do they show the same scene?"


def _identity(finding: Finding) -> str:
    if not finding.healthy:
        return "Both images show the same view: nothing moves between them, so there is no depth to measure."
    moved = finding.numbers.get("moved_px")
    return "The images differ." if moved is None else f"The images differ: features move by up to {moved:.0f} px."


def _sides(finding: Finding) -> str:
    if not finding.numbers["known"]:
        return "It is unclear which image is the left one: the pair is not rectified, and its features do not decide."
    disparities = f"disparities run from {finding.numbers['lowest_px']:.0f} to {finding.numbers['highest_px']:.0f} px"
    if finding.healthy:
        return f"Left is left: {disparities}."
    return f"Left and right look swapped: {disparities}, and they should be positive."


def _rows(finding: Finding) -> str:
    offset, spread = finding.numbers["offset_px"], f"spread {finding.numbers['spread_px']:.1f} px"
    if finding.healthy:
        return f"Rows match to {abs(offset):.1f} px ({spread})."
    side = "lower" if offset > 0 else "higher"
    return (
        f"The right image sits {abs(offset):.1f} px {side} than the left ({spread}): in a rectified pair, rows match."
    )


def _rotation(finding: Finding) -> str:
    degrees, growth = finding.numbers["rotation_deg"], finding.numbers["scale"] - 1
    said = f"The right image is rotated by {degrees:+.2f}° and scaled by {100 * growth:+.1f} %"
    return f"{said}: close enough." if finding.healthy else f"{said}: the pair is not rectified."


def _bent_rows(finding: Finding) -> str:
    numbers = finding.numbers
    spread = f"spread {numbers['spread_px']:.1f} px, of which {numbers['noise_px']:.1f} px are noise"
    if finding.healthy:
        return f"Rows do not bend ({spread})."
    said = (
        f"Rows bend: after the best shift, rotation and scale, they are still off by {numbers['lowest_px']:+.1f} to "
        f"{numbers['highest_px']:+.1f} px ({spread}). The lenses distort, or the cameras are turned. The page "
        "“Calibrate” measures both from pictures of a board."
    )
    if finding.remedy is None:
        return said
    lens = ", with one coefficient for the lenses" if numbers["lens"] else ""
    return f"{said} Rectified from the images alone{lens}, {numbers['rectified_px']:.1f} px remain on unused features."


def _exposure(finding: Finding) -> str:
    gain, offset = finding.numbers["gain"], finding.numbers["offset"]
    said = f"The right image has {gain:.2f} times the left one’s contrast, offset by {offset:+.0f} grey levels"
    if finding.healthy:
        return f"{said}: close enough."
    return f"{said}: ZNCC is unaffected, StereoBM and plain correlation suffer."


def _texture(finding: Finding) -> str:
    said = f"{100 * finding.numbers['flat_share']:.0f} % of the image has hardly any texture"
    return f"{said}." if finding.healthy else f"{said}: windows cannot be matched there. Larger windows help a little."


def _range(finding: Finding) -> str:
    numbers = finding.numbers
    low, high = numbers["lowest_px"], numbers["highest_px"]
    needed = f"{low:.0f} px" if round(low) == round(high) else f"{low:.0f} to {high:.0f} px"
    first, count = numbers["min_disparity"], numbers["num_disparities"]
    said = f"The pair needs about {needed}, and {first:.0f} to {first + count - 1:.0f} px are searched"
    if finding.healthy:
        return f"{said}: a good range."
    return f"{said}: too small a range." if numbers["missing_px"] > 0 else f"{said}: far more than needed."


_FINDINGS = {
    FindingCode.MATCHES: _matches,
    FindingCode.IDENTICAL: _identity,
    FindingCode.SWAPPED: _sides,
    FindingCode.ROWS: _rows,
    FindingCode.ROTATION: _rotation,
    FindingCode.BENT_ROWS: _bent_rows,
    FindingCode.EXPOSURE: _exposure,
    FindingCode.TEXTURE: _texture,
    FindingCode.RANGE: _range,
}
