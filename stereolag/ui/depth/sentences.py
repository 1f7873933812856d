"""Sentences of the depth page about results: remedies, judgements, matches, and alternative texts of pictures."""

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
    Remedy.TURN_UPRIGHT: "Turn both images by 90° (depth becomes relative)",
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
    return f"**Input doctor:** {'one problem' if count == 1 else f'{count} problems'} found in this {subject}."


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
    """Return the name of the criterion; capitalised if it comes `first` in a sentence."""
    name = "bad-2" if criterion is Criterion.TRUE_BAD_2 else "estimated bad-2"
    return name[0].upper() + name[1:] if first else name


def suggestion_in_words(suggestion: Suggestion) -> str:
    """Return the outcome of a search for better settings, with the figures before and after."""
    if isinstance(suggestion.outcome, Unjudged):
        return UNJUDGED[suggestion.outcome]
    ended = "" if suggestion.finished else " The search was stopped before it had tried everything."
    method, name = suggestion.start.title, bad_2(suggestion.criterion, first=True)
    if suggestion.outcome is Outcome.BETTER:
        return (
            f"The best of {suggestion.tried} settings tried for {method}. {name} on the whole images: "
            f"**{suggestion.bad_before:.1f} % → {suggestion.bad:.1f} %**.{ended}"
        )
    said = (
        f"{method} has no other settings to try over this range."
        if suggestion.finished and not suggestion.tried
        else f"Your {method} settings are as good: none of the {suggestion.tried} tried is clearly better."
    )
    return f"{said} {name}: **{suggestion.bad_before:.1f} %**.{ended}"


def search_so_far(suggestion: Suggestion) -> str:
    """Return the progress of a search for settings."""
    yours = (
        f"{suggestion.start.title}: {suggestion.tried} tried. "
        f"Yours: {bad_2(suggestion.criterion)} {suggestion.bad_before:.1f} %."
    )
    if not suggestion.trials:
        return yours
    gain = max(0.0, *(trial.gain for trial in suggestion.trials))
    return f"{yours} Best so far: {gain:.1f} points lower."


def sweep_caption(criterion: Criterion, *, judged: bool, finished: bool, pair: str = "") -> str:
    """Return the caption of a sweep; `pair` names the pair that the maps show, if there are several."""
    maps = f"The maps show {pair}. " if pair else ""
    if judged:
        maps = (
            f"Left: the maps{f' of {pair}' if pair else ''}. "
            f"Right: {bad_2(criterion)}, %, lower is better. Solid frame: the best. "
        )
    ended = "" if finished else " The sweep was stopped before it had tried everything."
    return f"{maps}Dotted frame: the settings in use.{ended}"


def value_in_words(value: object) -> str:
    """Return the value of a setting for a table; for an enabled stage, the values of its settings."""
    if value is None or value is False:
        return "off"
    if value is True:
        return "on"
    if isinstance(value, Settings):
        fields = type(value).model_fields
        return ", ".join(f"{fields[name].title or name} {nested}" for name, nested in value)
    return f"{value:g}" if isinstance(value, int | float) else str(value)


SAMPLING_STEP = 4
"""Every fourth row and column, px: enough for the range of a map, in a sixteenth of the time."""

ORDINALS = {2: "second", 3: "third"}


@typesets
def map_in_words(disparity: FloatMap, name: str = "disparity map") -> str:
    """Return the share of a map that has a disparity, and its range without the lowest and the highest 1 %."""
    known = disparity[::SAMPLING_STEP, ::SAMPLING_STEP]
    known = known[np.isfinite(known)]
    if known.size == 0:
        return f"{name}, no pixel measured"
    low, high = np.percentile(known, (1, 99))
    share = np.count_nonzero(np.isfinite(disparity)) / disparity.size
    return f"{name}, {percent(share)} measured, {low:.0f} to {high:.0f} px"


@typesets
def difference_in_words(difference: FloatMap) -> str:
    """Return the shares of the pixels where two maps agree to 1 px and where they differ either way."""
    known = difference[np.isfinite(difference)]
    if known.size == 0:
        return "no pixel that both measured"
    return (
        f"{percent(float(np.mean(np.abs(known) <= 1)))} of the pixels that both measured differ by 1 px at most, "
        f"{percent(float(np.mean(known > 1)))} are larger in the first, {percent(float(np.mean(known < -1)))} smaller"
    )


def agreement_in_words(count: int, agreed: Mask, wrong: Sequence[float] | None = None, *, strong: bool = False) -> str:
    """Return the share of the pixels on which all methods agree.

    Parameters
    ----------
    count
        Number of methods.
    agreed
        Mask of the pixels on which they agree.
    wrong
        Shares that are wrong, %: first of the pixels in `agreed`, then of those that each method measured.
    strong
        Whether the share is bold and the text a whole sentence.
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
    """Return the size of a photograph."""
    return f"photograph, {image.shape[1]:,} by {image.shape[0]:,} pixels"


REASONS_EXPLAINED = {
    Reason.FILLED: "Not measured: filled in from the surface behind.",
    Reason.OUT_OF_FRAME: "The window, or the place where it should be found, lies outside the right image.",
    Reason.LOW_TEXTURE: "The window is nearly blank, like a bare wall: there is nothing to compare.",
    Reason.AMBIGUOUS: "Another place fits nearly as well: a fence, a repeating pattern, or a smooth surface.",
    Reason.LEFT_RIGHT: "Matched from the right image, the disparity differs: usually something nearer hides the point.",
    Reason.SPECKLE: "A small island of disparities unlike its surroundings: usually a chance match.",
    Reason.AT_SEARCH_EDGE: "The best match is on the edge of the search area: the true one may lie beyond it.",
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

    def curve_in_words(name: str, curve: CoverageCurve) -> str:
        full = int(np.argmax(curve.coverage))
        at_full = f"{name}: {curve.bad[full]:.1f} % wrong at {percent(float(curve.coverage[full]))} kept"
        if curve.coverage.size == 1:
            return at_full
        half = int(np.argmin(np.abs(curve.coverage - curve.coverage[full] / 2)))
        return f"{at_full}, {curve.bad[half]:.1f} % at {percent(float(curve.coverage[half]))}"

    return "Error against coverage. " + "; ".join(curve_in_words(*item) for item in curves.items()) + "."


@typesets
def overlap_in_words(grid: WindowGrid, asked: float) -> str:
    """Return the text beside the figure of overlapping windows; `asked` is the overlap in the settings, 0..1."""
    actual = percent(grid.overlap)
    rounded = f" ({actual} in whole pixels)" if percent(asked) != actual else ""
    ordinal = ORDINALS.get(grid.every, f"{grid.every}th")
    thinned = f" Only every {ordinal} window and dot is drawn." if grid.every > 1 else ""
    return (
        f"{grid.middle.height} px windows, {percent(asked)} overlap{rounded}: one every {grid.step} px, so "
        f"{counted(grid.values, 'value')} in this cutout. Each dot is the centre of a window and becomes one value of "
        f"the map.{thinned}"
    )


def metres_in_words(calibration: Calibration | None, entered: str) -> str:
    """Return a sentence that says where the metres come from; `entered` names a distance that the visitor entered."""
    if calibration is None:
        return (
            "**Relative**: without a calibration, disparity tells which point is nearer, but not how many metres away "
            "it is. One known distance is enough: click a point and enter its distance below."
        )
    product = f"focal length × baseline = **{calibration.focal_px * calibration.baseline_m:.4g} px·m**"
    if entered:
        return f"**Metric**, from {entered}: {product}."
    return (
        f"**Metric**, from the pair’s calibration: {calibration.focal_px:.6g} px × {calibration.baseline_m:.4g} m, "
        f"{product}."
    )


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
    listed = ", ".join(f"{name} {error:.2f} px" for name, error in errors.items())
    return f"{formula}, where δd is the median error of each method against the ground truth: {listed}."


def markdown_table(lines: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; the first line holds the headings."""
    head, *rest = (f"| {' | '.join(cells)} |" for cells in lines)
    return "\n".join([head, "|---" * len(lines[0]) + "|", *rest])


@typesets
def scores_in_words(match: MatchExplanation, shape: str) -> str:
    """Return the peak and the runner-up of one window's scores."""
    if match.peak is None:
        return f"{shape}: no place has a score."
    said = f"{shape}: the peak, {match.peak_score:.3f}, is at a disparity of {-match.peak[1]} px"
    if match.runner_up is None:
        return f"{said}, and no other place rivals it."
    return f"{said}; the runner-up, {match.runner_up_score:.3f}, is at {-match.runner_up[1]} px."


@typesets
def fit_in_words(match: MatchExplanation) -> str:
    """Return the position of the maximum of the curve through the scores next to the peak."""
    top = "no disparity is taken" if math.isnan(match.disparity) else f"its top is at {match.disparity:.2f} px"
    return f"Curve through the scores next to the peak: {top}."


@typesets
def sweep_in_words(sweep: Sweep, titles: tuple[str, str]) -> str:
    """Return the number of values tried in a sweep, and its best cell if known."""
    tried = f"{len(sweep.rows)} values of {titles[0]} down, {len(sweep.cols)} of {titles[1]} across"
    if sweep.best is None:
        return f"{tried}."
    row, col = sweep.best
    return (
        f"{tried}. Best: {titles[0]} {sweep.rows[row]}, {titles[1]} {sweep.cols[col]}, "
        f"{sweep.bad[row, col]:.1f} % off by more than 2 px or missing."
    )


# Why this match?

MAX_MATCH_ERROR_PX = 1.0
"""Largest error of a match that is called right, px."""

SAME_DISPARITY_PX = 0.05
"""Largest difference between a match and the finished map that goes unmentioned, px."""

EXAMPLE_LABELS = {
    ExampleKind.CLEAR: "A clear match",
    ExampleKind.REPEATS: "A pattern that repeats",
    ExampleKind.BARE: "A bare wall",
    ExampleKind.HIDDEN: "Hidden from the right camera",
}
NO_EXAMPLE = {
    ExampleKind.CLEAR: "No window of this pair has one clear peak with these window and search settings.",
    ExampleKind.REPEATS: "Nothing repeats here: in no window examined does a second place, off the slopes of the peak, "
    "score nearly as high as the best.",
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


def match_in_words(match: MatchExplanation) -> str:
    """Return a sentence about the scores of a match, before any check or filter of the map."""
    runner_up = f"{match.runner_up_score:.3f}"
    return MATCHES[match.kind].format(
        peak=f"{match.peak_score:.3f}",
        runner_up=runner_up,
        next="" if math.isnan(match.runner_up_score) else f"; the next one scores {runner_up}",
        flank=f"{match.flank_score:.3f}",
        contrast=percent(match.contrast),
        alike="the pattern repeats, like a fence" if match.valley_depth > MIN_VALLEY_DEPTH else "they look alike",
    )


def match_against_truth(match: MatchExplanation, truth: float) -> str:
    """Return a sentence that compares a match with the ground truth, px; "" without either."""
    disparity = match.disparity
    if math.isnan(disparity):
        return "" if math.isnan(truth) else _truth_in_words(match, truth)
    if math.isnan(truth):
        return f"The disparity is {disparity:.2f} px; no ground truth is known here." + DOUBTS.get(match.kind, "")
    both = f"{disparity:.2f} px, and the ground truth is {truth:.2f} px"
    error = abs(disparity - truth)
    right, wrong = JUDGEMENTS[match.kind]
    if error <= MAX_MATCH_ERROR_PX:
        return f"{right}: {both}."
    runner_up = math.nan if match.runner_up is None else -match.runner_up[1]
    there = " The true place is the runner-up." if abs(runner_up - truth) <= MAX_MATCH_ERROR_PX else ""
    return f"{wrong} by {error:.1f} px: {both}.{there}"


JUDGEMENTS = {
    MatchKind.CLEAR: ("It is **right**", "It is **wrong** all the same,"),
    MatchKind.REPEATS: ("The better of the two is **right**", "The better of the two is **wrong**"),
    MatchKind.SMOOTH: ("The best of them is **right**", "The best of them is **wrong**"),
    MatchKind.BARE: ("Its place is **right** all the same", "Its place is **wrong**"),
    MatchKind.UNLIKE: ("Its place is **right** all the same", "Its place is **wrong**"),
}
"""The judgement of a match of each kind, if it is right and if it is wrong."""

DOUBTS = {
    MatchKind.REPEATS: " The scores cannot tell which of the two is the true place.",
    MatchKind.SMOOTH: " The scores cannot tell how far off it is.",
    MatchKind.BARE: " The score is weak evidence for it.",
    MatchKind.UNLIKE: " The score is weak evidence for it.",
}


def _truth_in_words(match: MatchExplanation, truth: float) -> str:
    first, last = -int(match.dx[-1]), -int(match.dx[0])
    outside = "" if first <= truth <= last else f", outside the search, which runs from {first} to {last} px"
    return f"The ground truth is {truth:.2f} px{outside}."


def fate_in_words(match: MatchExplanation, truth: float, reason: Reason, disparity: float) -> str:
    """Return a sentence that says what became of a match in the finished map.

    Parameters
    ----------
    match
        The match, before any check or filter.
    truth
        Ground truth, px; NaN = unknown.
    reason, disparity
        Reason and disparity of the map at the pixel, px; NaN = blank.
    """
    error = abs(match.disparity - truth)
    if reason == Reason.FILLED:
        return f"The map filled in {disparity:.2f} px from its surroundings."
    if reason == Reason.MEASURED:
        if math.isnan(disparity) or abs(match.disparity - disparity) <= SAME_DISPARITY_PX:
            return "The map keeps it."
        return f"After filtering, the map has {disparity:.2f} px."
    if math.isnan(match.disparity):
        return "The map is blank here."
    how = "as it should be" if error > MAX_MATCH_ERROR_PX else "all the same" if error <= MAX_MATCH_ERROR_PX else ""
    return f"The map is blank here{f', {how}' if how else ''} ({REASON_WORDS[reason]})."


def match_verdict(
    match: MatchExplanation,
    truth: float = math.nan,
    *,
    visible: bool = True,
    reason: Reason | None = None,
    disparity: float = math.nan,
) -> str:
    """Return a paragraph about a match: its scores, whether it is right, and what became of it in the map.

    Parameters
    ----------
    match, truth
        The match, and the ground truth at its pixel, px; NaN = unknown.
    visible
        Whether the right camera sees the pixel, as far as is known.
    reason, disparity
        Reason and disparity at the pixel in the finished map of the same matcher; reason is None if there is no map.
    """
    said = (
        f"**{match_in_words(match)}**",
        match_against_truth(match, truth),
        "" if visible else HIDDEN_FROM_RIGHT,
        "" if reason is None else fate_in_words(match, truth, reason, disparity),
    )
    return " ".join(filter(None, said))


# The live camera

CAMERAS = {
    "beside": "One camera, views side by side",
    "half-beside": "One camera, views side by side, squeezed",
    "over-under": "One camera, one view above the other",
    "half-over-under": "One camera, one view above the other, squeezed",
    "two": "Two webcams",
    "moved": "One webcam, moved by hand",
}

LIVE_CAMERA_WORDS = {
    "about": "Start the camera: its maps appear here, and every control acts on the live picture. The rows of both "
    "views must match: calibrate the cameras, or freeze a frame and let the input doctor rectify it.",
    "first": "Take the left picture",
    "again": "Take the left picture again",
    "record": "Record",
    "finish": "Finish",
    "recorded": "Frames recorded:",
    "skew": "Time between both views:",
    "oneCamera": "Both views come from the same camera. Choose another one for the right view.",
}
