"""All sentences of the depth page about results: findings, judgements, matches, alternatives of pictures and charts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from stereolag import Calibration, Reason, Suggestion
from stereolag.assess.explaining import MIN_VALLEY_DEPTH, ExampleKind, MatchExplanation, MatchKind
from stereolag.assess.findings import Finding, Remedy
from stereolag.assess.judging import Criterion, Sweep, Unjudged
from stereolag.assess.suggestion import Outcome
from stereolag.core.arrays import FloatMap, Mask, ReasonMap
from stereolag.core.inputs import Image
from stereolag.core.settings import Settings
from stereolag.core.typography import counted, percent, typesets
from stereolag.figures.match import WindowGrid
from stereolag.figures.verdicts import REASON_WORDS, blanks_in_words
from stereolag.stereo.evaluation import CoverageCurve

REMEDIES_OFFERED = {
    Remedy.MIRROR_RIGHT: "Mirror the right image",
    Remedy.TURN_UPRIGHT: "Turn both images by a quarter (depth becomes relative)",
    Remedy.SWAP_SIDES: "Swap left and right",
    Remedy.ALIGN_ROWS: "Align the rows",
    Remedy.LEVEL: "Rectify from the images alone (depth becomes relative)",
    Remedy.RECTIFY: "Rectify both images for now (depth becomes relative)",
    Remedy.MATCH_EXPOSURE: "Match the brightness",
    Remedy.SET_RANGE: "Search {suggested_num_disparities:.0f} disparities from {suggested_min_disparity:.0f}",
}
"""The label of the button that applies each remedy, with the numbers of its finding."""


def problems_in_words(count: int, subject: str = "pair") -> str:
    """Return a sentence with the number of problems found."""
    return f"**Input doctor:** {'one problem' if count == 1 else f'{count} problems'} found on this {subject}."


def remedy_in_words(finding: Finding) -> str:
    """Return the label of the button that applies the remedy of a finding."""
    return REMEDIES_OFFERED[finding.remedy].format(**finding.numbers) if finding.remedy else ""


JUDGED_BY = {
    Criterion.TRUE_BAD_2: (
        "They are judged by bad-2: the share of the pixels with ground truth that are **off by more than 2 px or "
        "missing**."
    ),
    Criterion.ESTIMATED_BAD_2: (
        "There is no ground truth, so bad-2 is **estimated** against the accurate preset: the share of the pixels it "
        "measured (not those it filled) that are off by more than 2 px from it, or missing."
    ),
}

UNJUDGED = {
    Unjudged.JUDGES_ITSELF: (
        "Without ground truth there is nothing to judge Semi-global by: the accurate preset, which judges the others, "
        "is Semi-global itself. Add a ground truth to judge it too."
    ),
    Unjudged.TOO_LITTLE_MEASURED: (
        "There is nothing to judge by: without ground truth the accurate preset is the judge, and it measured too "
        "little of this pair. Check the input doctor’s findings and the search range."
    ),
}


def bad_2(criterion: Criterion, *, first: bool = False) -> str:
    """Return the name of the figure; capitalised if it comes `first` in a sentence."""
    name = "bad-2" if criterion is Criterion.TRUE_BAD_2 else "estimated bad-2"
    return name[0].upper() + name[1:] if first else name


def suggestion_in_words(found: Suggestion) -> str:
    """Return the outcome of a search for settings, with its figures."""
    if isinstance(found.outcome, Unjudged):
        return UNJUDGED[found.outcome]
    ended = "" if found.finished else " The search was ended before it had tried everything."
    method, name = found.start.title, bad_2(found.criterion, first=True)
    if found.outcome is Outcome.BETTER:
        change = f"{found.bad_before:.1f} % → {found.bad:.1f} %"
        return f"The best of {found.tried} tried for {method}. {name} on the whole images: **{change}**.{ended}"
    said = f"Your {method} settings are as good: none of the {found.tried} tried is clearly better."
    if found.finished and not found.tried:
        said = f"{method} has no other settings to try over this range."
    return f"{said} {name}: **{found.bad_before:.1f} %**.{ended}"


def search_so_far(found: Suggestion) -> str:
    """Return the progress of a search for settings."""
    yours = f"{found.start.title}: {found.tried} tried. Yours: {bad_2(found.criterion)} {found.bad_before:.1f} %."
    if not found.trials:
        return yours
    gain = max(0.0, *(trial.gain for trial in found.trials))
    return f"{yours} The best so far: {gain:.1f} points less."


def sweep_in_words(criterion: Criterion, *, judged: bool, finished: bool, of: str = "") -> str:
    """Return the caption of a sweep; `of` names the pair that the maps show, if there are several."""
    maps = f"the maps of {of}" if of else "the maps"
    said = f"The maps are of {of}. " if of else ""
    if judged:
        said = f"Left: {maps}. Right: {bad_2(criterion)}, %, lower is better. Solid frame: the best. "
    ended = "" if finished else " The sweep was ended before it had tried everything."
    return f"{said}Dotted frame: the settings in use.{ended}"


def value_in_words(value: object) -> str:
    """Return the value of a setting for a table; an enabled stage is shown by its own settings."""
    if value is None or value is False:
        return "off"
    if value is True:
        return "on"
    if isinstance(value, Settings):
        fields = type(value).model_fields
        return ", ".join(f"{fields[name].title or name} {one}" for name, one in value)
    return f"{value:g}" if isinstance(value, int | float) else str(value)


EVERY = 4
"""Sampling step of rows and columns: enough for the range of a map, in a sixteenth of the time."""


ORDINALS = {2: "second", 3: "third"}


@typesets
def map_in_words(disparity: FloatMap, what: str = "disparity map") -> str:
    """Return the share of a map that has a disparity, and the range of all but the outermost 2 %."""
    known = disparity[::EVERY, ::EVERY]
    known = known[np.isfinite(known)]
    if known.size == 0:
        return f"{what}, no pixel measured"
    low, high = np.percentile(known, (1, 99))
    share = np.count_nonzero(np.isfinite(disparity)) / disparity.size
    return f"{what}, {percent(share)} measured, {low:.0f} to {high:.0f} px"


@typesets
def difference_in_words(difference: FloatMap) -> str:
    """Return how much two maps differ."""
    known = difference[np.isfinite(difference)]
    if known.size == 0:
        return "no pixel that both measured"
    return (
        f"{percent(float(np.mean(np.abs(known) <= 1)))} of the pixels that both measured differ by 1 px at most, "
        f"{percent(float(np.mean(known > 1)))} are larger in the first, {percent(float(np.mean(known < -1)))} smaller"
    )


def agreement_in_words(count: int, agreed: Mask, wrong: Sequence[float] | None = None, *, strong: bool = False) -> str:
    """Return how many pixels all methods agree on, in bold or not.

    `wrong` is, in %, how many of those are wrong, then how many of the pixels that each method measured.
    """
    everyone = "Both methods" if count == 2 else f"All {count} methods"
    share = percent(float(agreed.mean()))
    said = f"{everyone} agree to 1 px on {f'**{share}**' if strong else share} of the pixels"
    if wrong is not None:
        said += (
            f". There, **{wrong[0]:.1f} %** are wrong by more than 1 px; of all the pixels each method measured, "
            f"{min(wrong[1:]):.1f} to {max(wrong[1:]):.1f} %. Methods that work differently seldom make the same errors"
        )
    return f"{said}." if strong else said


@typesets
def photograph_in_words(image: Image) -> str:
    """Return the size of a photograph in words."""
    return f"photograph, {image.shape[1]:,} by {image.shape[0]:,} pixels"


REASONS_EXPLAINED = {
    Reason.FILLED: "Not measured: filled in from the surface behind.",
    Reason.OUT_OF_FRAME: "The window, or the place where it should be found, lies outside the right image.",
    Reason.LOW_TEXTURE: "The window is nearly blank, like a bare wall: there is nothing to compare.",
    Reason.AMBIGUOUS: "Another place fits nearly as well: a fence, a repeating pattern, or a smooth surface.",
    Reason.LEFT_RIGHT: "Matched from the right image, the disparity differs: usually something nearer hides the point.",
    Reason.SPECKLE: "A small island of disparities unlike its surroundings: usually a chance match.",
    Reason.AT_SEARCH_EDGE: "The best match is on the edge of the search area: the true one may be beyond it.",
}


@typesets
def all_blanks_in_words(reasons: Mapping[str, ReasonMap]) -> str:
    """Return the shares of the reasons for every method."""
    return "; ".join(f"{name}: {blanks_in_words(reason)}" for name, reason in reasons.items()) + "."


@typesets
def errors_in_words(disparity: FloatMap, truth: FloatMap, against: str) -> str:
    """Return the shares of wrong and of missing pixels of a map."""
    error = np.abs(disparity - truth)[np.isfinite(truth)]
    wrong = 100 * float(np.mean(error > 2))
    missing = 100 * float(np.mean(np.isnan(error)))
    return f"Error map against {against}: {wrong:.1f} % off by more than 2 px, {missing:.1f} % without a disparity."


@typesets
def coverage_curves_in_words(curves: Mapping[str, CoverageCurve]) -> str:
    """Return the error of each method at its full coverage and at half of it."""

    def told(name: str, curve: CoverageCurve) -> str:
        most = int(np.argmax(curve.coverage))
        whole = f"{name}: {curve.bad[most]:.1f} % wrong at {percent(float(curve.coverage[most]))} kept"
        if curve.coverage.size == 1:
            return whole
        half = int(np.argmin(np.abs(curve.coverage - curve.coverage[most] / 2)))
        return f"{whole}, {curve.bad[half]:.1f} % at {percent(float(curve.coverage[half]))}"

    return "Error against coverage. " + "; ".join(told(name, curve) for name, curve in curves.items()) + "."


@typesets
def overlap_in_words(grid: WindowGrid, asked: float) -> str:
    """Return the text beside the figure of overlapping windows; `asked` is the overlap in the settings, 0..1."""
    there = percent(grid.overlap)
    actual = f" ({there} in whole pixels)" if percent(asked) != there else ""
    which = ORDINALS.get(grid.every, f"{grid.every}th")
    left_out = f" Only every {which} window and dot is drawn." if grid.every > 1 else ""
    return (
        f"{grid.middle.height} px windows, {percent(asked)} overlap{actual}: one every {grid.step} px, so "
        f"{counted(grid.values, 'value')} in this cut. Each dot is the centre of a window and becomes one value of the "
        f"map.{left_out}"
    )


def metres_in_words(calibration: Calibration | None, entered: str) -> str:
    """Return a sentence about the source of the metres; `entered` names the distance that the visitor entered."""
    if calibration is None:
        return (
            "**Relative**: without a calibration, disparity tells which point is nearer, but not how many metres away "
            "it is. One known distance is enough: click a point and enter its distance below."
        )
    product = f"focal length × baseline = **{calibration.focal_px * calibration.baseline_m:.4g} px·m**"
    if entered:
        return f"**Metric**, from {entered}: {product}."
    factors = f"{calibration.focal_px:.6g} px × {calibration.baseline_m:.4g} m"
    return f"**Metric**, from the pair’s calibration: {factors}, {product}."


def length_in_words(metres: float, error: float) -> str:
    """Return a length with its error, to two significant digits of the error and at most 4 decimals; "–" for NaN."""
    if math.isnan(metres):
        return "–"
    if error == 0:
        return f"{metres:.4g} m"
    decimals = min(max(1 - math.floor(math.log10(error)), 0), 4)
    return f"{metres:.{decimals}f} ± {error:.{decimals}f} m"


def uncertainty_in_words(errors: Mapping[str, float], *, measured: bool) -> str:
    """Return a sentence about the source of the uncertainty, from the error of each method's disparities, px."""
    formula = "The uncertainty of a depth is Z² · δd / (f · B)"
    if not measured:
        return f"{formula}, with δd = {next(iter(errors.values())):g} px, typical of a good match."
    told = ", ".join(f"{name} {error:.2f} px" for name, error in errors.items())
    return f"{formula}, where δd is the median error of each method against the ground truth: {told}."


def markdown_table(lines: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; the first line holds the headings."""
    head, *rest = (f"| {' | '.join(cells)} |" for cells in lines)
    return "\n".join([head, "|---" * len(lines[0]) + "|", *rest])


@typesets
def scores_in_words(seen: MatchExplanation, shape: str) -> str:
    """Return the peak and the runner-up of one window's scores."""
    if seen.peak is None:
        return f"{shape}: no place has a score."
    said = f"{shape}: the peak, {seen.peak_score:.3f}, is at a disparity of {-seen.peak[1]} px"
    if seen.runner_up is None:
        return f"{said}, and no other place rivals it."
    return f"{said}; the runner-up, {seen.runner_up_score:.3f}, is at {-seen.runner_up[1]} px."


@typesets
def fit_in_words(seen: MatchExplanation) -> str:
    """Return the position of the maximum of the curve through the scores next to the peak."""
    found = "no disparity is taken" if math.isnan(seen.disparity) else f"its top is at {seen.disparity:.2f} px"
    return f"Curve through the scores next to the peak: {found}."


@typesets
def sheet_in_words(sheet: Sweep, titles: tuple[str, str]) -> str:
    """Return the values tried in a sweep, and its best cell if known."""
    tried = f"{len(sheet.rows)} values of {titles[0]} down, {len(sheet.cols)} of {titles[1]} across"
    if sheet.best is None:
        return f"{tried}."
    row, col = sheet.best
    best = f"{titles[0]} {sheet.rows[row]}, {titles[1]} {sheet.cols[col]}"
    return f"{tried}. Best: {best}, {sheet.bad[row, col]:.1f} % off by more than 2 px or missing."


# Why this match?

RIGHT_PX = 1.0
"""Largest error of a match called right, px."""

SAME_PX = 0.05
"""Disparities that differ by no more than this are given once, px."""

EXAMPLE_LABELS = {
    ExampleKind.CLEAR: "A clear match",
    ExampleKind.REPEATS: "A pattern that repeats",
    ExampleKind.BARE: "A bare wall",
    ExampleKind.HIDDEN: "Hidden from the right camera",
}
NO_EXAMPLE = {
    ExampleKind.CLEAR: "No window of this pair has one clear peak with these window and search settings.",
    ExampleKind.REPEATS: "Nothing repeats here: no window examined has a second place, away from the peak’s own "
    "slopes, that scores nearly as high as the best.",
    ExampleKind.BARE: "Every window has enough texture with these settings: there is no bare wall.",
    ExampleKind.HIDDEN: "No part of this pair was found to be hidden from the right camera.",
}
HIDDEN_FROM_RIGHT = (
    "The right camera cannot see this point, because something nearer hides it: the window matched the point’s "
    "surroundings."
)

HOVER_WORDS = {
    "title": "The match of the window under the pointer",
    "window": "Window, left",
    "above": "Every score, from above",
    "axis": "The search in the right image, and its scores:  ← nearer    disparity, px    farther →",
    "row": "Row",
    "column": "column",
    "up": "up",
    "down": "down",
    "peak": "best",
    "runner_up": "runner-up",
    "truth": "true place",
    "kinds": {
        MatchKind.CLEAR: "one clear peak",
        MatchKind.REPEATS: "two peaks as good as each other",
        MatchKind.SMOOTH: "one broad peak, too smooth to tell neighbours apart",
        MatchKind.BARE: "a bare wall, mostly noise",
        MatchKind.UNLIKE: "nothing looks like this",
        MatchKind.AT_EDGE: "highest at the edge of the search, perhaps higher beyond",
        MatchKind.NOTHING: "nothing to correlate",
    },
}


MATCHES = {
    MatchKind.CLEAR: "One clear peak: {peak}{next}.",
    MatchKind.NOTHING: "Nothing to correlate: the window is flat, or every place it could match lies outside the "
    "image.",
    MatchKind.AT_EDGE: "The best score is on the edge of the search area or of the image, and a better one may be "
    "beyond it: no disparity is taken from it.",
    MatchKind.BARE: "A bare wall: the window has {contrast} of the image’s contrast, and its best score is {peak}. It "
    "compares mostly noise.",
    MatchKind.UNLIKE: "Nothing looks like this: the best score is {peak}.",
    MatchKind.REPEATS: "Two places fit almost equally well ({peak} and {runner_up}), with worse ones between them: "
    "{alike}.",
    MatchKind.SMOOTH: "Neighbouring places fit almost equally well ({peak}, and {flank} farther than 1 px from it): "
    "the window is too smooth to tell them apart.",
}


def match_in_words(seen: MatchExplanation) -> str:
    """Return a sentence about the match based on its scores alone, whatever the map made of it."""
    runner_up = f"{seen.runner_up_score:.3f}"
    return MATCHES[seen.kind].format(
        peak=f"{seen.peak_score:.3f}",
        runner_up=runner_up,
        next="" if math.isnan(seen.runner_up_score) else f"; the next one scores {runner_up}",
        flank=f"{seen.flank_score:.3f}",
        contrast=percent(seen.contrast),
        alike="the pattern repeats, like a fence" if seen.valley_depth > MIN_VALLEY_DEPTH else "they look alike",
    )


def match_against_truth(seen: MatchExplanation, truth: float) -> str:
    """Return a sentence comparing the match with the ground truth, px; "" if there is nothing to say."""
    disparity = seen.disparity
    if math.isnan(disparity):
        return "" if math.isnan(truth) else _truth_alone(seen, truth)
    if math.isnan(truth):
        return f"The disparity is {disparity:.2f} px, and no ground truth is known here." + DOUBT.get(seen.kind, "")
    both = f"{disparity:.2f} px, and the ground truth is {truth:.2f} px"
    error = abs(disparity - truth)
    right, wrong = FOUND[seen.kind]
    if error <= RIGHT_PX:
        return f"{right}: {both}."
    runner_up = math.nan if seen.runner_up is None else -seen.runner_up[1]
    there = " The true place is the runner-up." if abs(runner_up - truth) <= RIGHT_PX else ""
    return f"{wrong} by {error:.1f} px: {both}.{there}"


FOUND = {
    MatchKind.CLEAR: ("It is **right**", "It is **wrong** all the same,"),
    MatchKind.REPEATS: ("The better of the two is **right**", "The better of the two is **wrong**"),
    MatchKind.SMOOTH: ("The best of them is **right**", "The best of them is **wrong**"),
    MatchKind.BARE: ("Its place is **right** all the same", "Its place is **wrong**"),
    MatchKind.UNLIKE: ("Its place is **right** all the same", "Its place is **wrong**"),
}
"""What is said of a match of each kind that is right, and of one that is wrong."""
DOUBT = {
    MatchKind.REPEATS: " The scores cannot tell which of the two is the true place.",
    MatchKind.SMOOTH: " The scores cannot tell how far off it is.",
    MatchKind.BARE: " The score is weak evidence for it.",
    MatchKind.UNLIKE: " The score is weak evidence for it.",
}


def _truth_alone(seen: MatchExplanation, truth: float) -> str:
    least, most = -int(seen.dx[-1]), -int(seen.dx[0])
    beyond = "" if least <= truth <= most else f", outside the search, which runs from {least} to {most} px"
    return f"The ground truth is {truth:.2f} px{beyond}."


def fate_in_words(seen: MatchExplanation, truth: float, reason: Reason, disparity: float) -> str:
    """Return a sentence about the fate of the match in the finished map.

    Parameters
    ----------
    seen
        The match, before any check or filter.
    truth
        Ground truth, px; NaN = unknown.
    reason, disparity
        Reason and disparity of the map at the pixel, px; NaN = blank.
    """
    error = abs(seen.disparity - truth)
    if reason == Reason.FILLED:
        return f"The map filled in {disparity:.2f} px from its surroundings."
    if reason == Reason.MEASURED:
        if math.isnan(disparity) or abs(seen.disparity - disparity) <= SAME_PX:
            return "The map keeps it."
        return f"After filtering, the map has {disparity:.2f} px."
    if math.isnan(seen.disparity):
        return "The map is blank here."
    how = "as it should be" if error > RIGHT_PX else "all the same" if error <= RIGHT_PX else ""
    return f"The map is blank here{f', {how}' if how else ''} ({REASON_WORDS[reason]})."


def match_verdict(
    seen: MatchExplanation,
    truth: float = math.nan,
    *,
    visible: bool = True,
    reason: Reason | None = None,
    disparity: float = math.nan,
) -> str:
    """Return one consistent paragraph about a match.

    Parameters
    ----------
    seen, truth
        The match, and the ground truth at its pixel, px; NaN = unknown.
    visible
        Whether the right camera sees the pixel, as far as is known.
    reason, disparity
        Reason and disparity at the pixel in the finished map of the same matcher; reason is None if there is no map.
    """
    said = (
        f"**{match_in_words(seen)}**",
        match_against_truth(seen, truth),
        "" if visible else HIDDEN_FROM_RIGHT,
        "" if reason is None else fate_in_words(seen, truth, reason, disparity),
    )
    return " ".join(filter(None, said))


# The live camera

CAMERAS = {
    "beside": "One camera, both views beside each other",
    "half-beside": "One camera, beside each other, squeezed",
    "over-under": "One camera, one view above the other",
    "half-over-under": "One camera, above each other, squeezed",
    "two": "Two webcams",
    "moved": "One webcam, moved by hand",
}

LIVE_CAMERA_WORDS = {
    "about": "Start the camera: its maps appear here, and every control acts on the running picture. The rows of both "
    "views must match: calibrate the cameras, or freeze a frame and let the input doctor rectify it.",
    "first": "Take the left picture",
    "again": "Take the left picture again",
    "record": "Record",
    "finish": "Finish",
    "recorded": "Frames recorded:",
    "skew": "Taken apart by",
    "oneCamera": "Both views come from the same camera. Choose another one for the right view.",
}
