"""The findings of the input doctor in words, for pages and commands."""

from __future__ import annotations

from collections.abc import Mapping

from stereolag.assess.findings import Finding, FindingCode


def finding_in_words(finding: Finding) -> str:
    """Return the sentence for a finding, with its numbers."""
    numbers, healthy = finding.numbers, finding.healthy
    match finding.code:
        case FindingCode.MATCHES if healthy:
            return f"{numbers['count']:,.0f} features match between the images."
        case FindingCode.MATCHES:
            only = f"Only {numbers['count']:,.0f} features match" if numbers["count"] else "No features match"
            return f"{only} between the images, too few to judge the geometry: do they show the same scene?"
        case FindingCode.IDENTICAL if healthy:
            moved = f": features move by up to {numbers['moved_px']:.0f} px" if "moved_px" in numbers else ""
            return f"The images differ{moved}."
        case FindingCode.IDENTICAL:
            return "Both images show the same view: nothing moves between them, so there is no depth to measure."
        case FindingCode.LAYOUT if healthy:
            return "Each image shows one view."
        case FindingCode.LAYOUT:
            where = "beside" if numbers["beside"] else "above"
            squeezed = (
                f", squeezed to half their {'width' if numbers['beside'] else 'height'}" if numbers["half"] else ""
            )
            return f"The left image holds both views, one {where} the other{squeezed}: give it alone."
        case FindingCode.MIRRORED:
            count = f"{numbers['count']:,.0f} features match once it is mirrored back"
            return "Both images are the same way round." if healthy else f"The right image is mirrored: {count}."
        case FindingCode.ABOVE_EACH_OTHER:
            ill = "The cameras stand above each other: distance moves points up or down instead of sideways."
            return "The cameras do not stand above each other." if healthy else ill
        case FindingCode.ONE_MOVING_CAMERA if healthy:
            return "No camera stands in front of the other."
        case FindingCode.ONE_MOVING_CAMERA:
            ill = f"One moving camera may have taken both images: points move away from {_epipole(numbers)}"
            return f"{ill}, so rows do not match."
        case FindingCode.NOT_SAME_MOMENT if healthy:
            return "Nothing moved between the images."
        case FindingCode.NOT_SAME_MOMENT:
            return _not_same_moment(numbers)
        case FindingCode.SWAPPED if not numbers["known"]:
            unclear = "It is unclear which image is the left one"
            return f"{unclear}: the pair is not rectified, and its features do not decide."
        case FindingCode.SWAPPED:
            run = f"disparities run from {numbers['lowest_px']:.0f} to {numbers['highest_px']:.0f} px"
            swapped = f"Left and right look swapped: {run}, and they should be positive."
            return f"Left is left: {run}." if healthy else swapped
        case FindingCode.ROWS:
            offset, spread = numbers["offset_px"], f"spread {numbers['spread_px']:.1f} px"
            where = f"{abs(offset):.1f} px {'lower' if offset > 0 else 'higher'} than the left ({spread})"
            ill = f"The right image sits {where}: in a rectified pair, rows match."
            return f"Rows match to {abs(offset):.1f} px ({spread})." if healthy else ill
        case FindingCode.ROTATION:
            degrees, growth = numbers["rotation_deg"], 100 * (numbers["scale"] - 1)
            verdict = "close enough" if healthy else "the pair is not rectified"
            return f"The right image is rotated by {degrees:+.2f}° and scaled by {growth:+.1f} %: {verdict}."
        case FindingCode.BENT_ROWS:
            spread = f"spread {numbers['spread_px']:.1f} px, of which {numbers['noise_px']:.1f} px are noise"
            return f"Rows do not bend ({spread})." if healthy else _bent_rows(finding, spread)
        case FindingCode.EXPOSURE:
            gain, levels = numbers["gain"], f"offset by {numbers['offset']:+.0f} grey levels"
            verdict = "close enough" if healthy else "ZNCC is unaffected, StereoBM and plain correlation suffer"
            return f"The right image has {gain:.2f} times the left one’s contrast, {levels}: {verdict}."
        case FindingCode.TEXTURE:
            but = "" if healthy else ": windows cannot be matched there. Larger windows help a little"
            return f"{100 * numbers['flat_share']:.0f} % of the image has hardly any texture{but}."
        case FindingCode.EMPTY_BORDER:
            shares = f"{100 * numbers['left_share']:.0f} % of the left and {100 * numbers['right_share']:.0f} %"
            return f"{shares} of the right image are black borders{'' if healthy else ': nothing was seen there'}."
        case FindingCode.RANGE:
            low, high, first = numbers["lowest_px"], numbers["highest_px"], numbers["min_disparity"]
            needed = f"{low:.0f} px" if round(low) == round(high) else f"{low:.0f} to {high:.0f} px"
            searched = f"{first:.0f} to {first + numbers['num_disparities'] - 1:.0f} px are searched"
            ill = "too small a range" if numbers["missing_px"] > 0 else "far more than needed"
            told = f"The pair needs about {needed}, and {searched}: {'a good range' if healthy else ill}."
            every = f"The picture repeats every {numbers['repeats_px']:.0f} px along its rows: a search that is"
            return f"{told} {every} wider finds every point more than once." if numbers["repeats_px"] else told


def _not_same_moment(numbers: Mapping[str, float]) -> str:
    ill = (
        f"The images are not of the same moment: points move away from {_epipole(numbers)}, as from cameras that move, "
        "not as from two that stand side by side."
    )
    late = numbers.get("frames", 0)
    if not late:
        return ill
    frames = f"{abs(late):.0f} {'frame' if abs(late) == 1 else 'frames'} {'later' if late > 0 else 'earlier'}"
    return f"{ill} The right picture {frames} fits."


def _epipole(numbers: Mapping[str, float]) -> str:
    return f"one place, {100 * numbers['x']:.0f} % across and {100 * numbers['y']:.0f} % down the image"


def _bent_rows(finding: Finding, spread: str) -> str:
    numbers = finding.numbers
    said = (
        f"Rows bend: after the best shift, rotation and scale, they are still off by {numbers['lowest_px']:+.1f} to "
        f"{numbers['highest_px']:+.1f} px ({spread}). The lenses distort, or the cameras are turned. The page "
        "“Calibrate” measures both from pictures of a board."
    )
    if finding.remedy is None:
        return said
    lens = ", with one coefficient for the lenses" if numbers["lens"] else ""
    return f"{said} Rectified from the images alone{lens}, {numbers['rectified_px']:.1f} px remain on unused features."
