"""The verdict on each result in words, with which pages and notebooks begin."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import numpy as np

from stereolag.core.arrays import ReasonMap
from stereolag.core.typography import counted, enumeration, four_digits, typesets
from stereolag.io.results import over_time_in_words
from stereolag.signals import SignalLag
from stereolag.stereo.matcher import Reason
from stereolag.templates import TemplateMatch, TemplateSearch

MIN_UNCERTAINTY = 0.01
"""Least uncertainty of a lag that is reported, samples."""


def lag_in_words(result: SignalLag, assumed: Collection[str] = ()) -> str:
    """Return in words which sensor hears the sound later, by how much, the uncertainty, and the path difference.

    `assumed` names the settings given by neither a file nor the visitor.
    """
    over_time, hertz = result.over_time, f"{result.sampling_rate:,.10g} Hz"
    if over_time is not None and over_time.changes:
        rate = f", at {hertz}, assumed" if over_time.steps and "sampling_rate" in assumed else ""
        return f"Sensor 2 hears it **{over_time_in_words(over_time, result.sampling_rate)}**{rate}."
    doubt = "" if np.isnan(result.uncertainty) else f" ± {max(result.uncertainty, MIN_UNCERTAINTY):.1g}"
    if result.lag == 0:
        return f"Both sensors hear it **at the same time**{f' (0{doubt} samples)' if doubt else ''}."
    later, earlier = (2, 1) if result.lag > 0 else (1, 2)
    samples = f"{abs(result.lag_subsample):,.{_decimals(result.uncertainty)}f}{doubt} samples"
    given = [f"{result.speed:,.10g} m/s"] if "speed" in assumed else []
    given += [hertz] if "sampling_rate" in assumed else []
    at = f", at {' and '.join(given)}, {'both ' if len(given) > 1 else ''}assumed" if given else ""
    seconds, far = four_digits(abs(result.time_s)), result.distance_m
    # Short paths are those in a tank or along a bar.
    metres = f"{far:,.2f}" if far >= 0.1 else np.format_float_positional(far, 2, fractional=False)
    return (
        f"Sensor {later} hears it **{seconds} s** ({samples}) after sensor {earlier}: its path is "
        f"**{metres} m** longer{at}."
    )


def _decimals(uncertainty: float) -> int:
    """Return the number of decimals of a number with this uncertainty, at most two; 0 if it is not known."""
    return 0 if np.isnan(uncertainty) or uncertainty >= 1 else 1 if uncertainty >= 0.1 else 2


def verdict_in_words(result: SignalLag, assumed: Collection[str] = ()) -> str:
    """Return the lag in words if it is sure, otherwise why none can be given."""
    judgement = result.judgement
    if judgement.verdict == "sure":
        return lag_in_words(result, assumed)
    if judgement.reason == "repeats" and judgement.spacing is not None:
        return f"Cannot tell: it repeats every **{_samples(judgement.spacing)} samples**."
    if judgement.verdict == "ambiguous":
        lags = sorted((result.lag, *judgement.rivals))
        if len(lags) <= MAX_NAMED:
            return f"Cannot tell: **{enumeration([f'{lag:,}' for lag in lags])} samples** fit equally well."
        return f"Cannot tell: **at least {len(lags) - 1} other lags fit** as well."
    return NOTHING_WORDS[judgement.reason]


MAX_NAMED = 4
"""Largest number of lags that fit equally well and are all named."""

NOTHING_WORDS = {
    "chance": "Nothing in common found: the highest point is at chance level.",
    "one_lag": "Only a lag of 0 was searched, and the recordings do not agree there: allow a larger one.",
    "too_little": "Not sure of anything in common: so few samples agree that chance could line them up.",
    "few_votes": "Nothing found by sampling: hardly two samples vote for the same lag.",
    "opposite_sign": "Nothing in common found, but **the opposite sign fits**: one microphone is reversed.",
}

ADVICE = {
    "chance": "Use a longer stretch with a distinct sound that both sensors hear, and check that both files cover it.",
    "too_little": "One knock or swing fits any other like it. Use several at irregular times, or a longer sound, and "
    "check that both files cover it.",
}


def verdict_explained(result: SignalLag) -> list[str]:
    """Return the details of a verdict: arrivals, clocks, rivals, a reversed microphone, advice."""
    judgement, over_time = result.judgement, result.over_time
    said = []
    if result.begins_again_at is not None:
        said.append(f"The values of both wrap around every {result.begins_again_at:,.4g}: their steps were compared.")
    if over_time is not None and over_time.changes:
        said.append("A lag that changes is not due to the path alone, so no metres are given.")
    if len(result.arrivals) > 1 and judgement.reason != "repeats":
        shown = ", ".join(f"{round(one.lag):,} ({one.sigma:.1f} σ)" for one in result.arrivals[:MAX_LISTED])
        said.append(f"Arrivals beyond chance, samples: {shown}. The direct sound and its echoes, or several sounds.")
    if judgement.opposite_lag is not None:
        said.append(
            f"With its sign reversed, recording 2 fits at {judgement.opposite_lag:,} samples: swap the wires of one "
            "microphone, or negate one file."
        )
    elif judgement.verdict == "ambiguous":
        fit = "" if len(judgement.rivals) < MAX_NAMED else f"{_nearest(result)} fit about equally well. "
        said.append(f"{fit}A stretch that does not repeat, or a smaller largest lag, can decide.")
    elif judgement.reason == "few_votes" and result.arrivals:
        lag, sigma = result.arrivals[0]
        said.append(f"All samples together agree on a lag of {round(lag):,} ({sigma:.1f} σ): choose the method FFT.")
    elif judgement.verdict == "nothing":
        said.append(ADVICE.get(judgement.reason, ADVICE["chance"]))
        if result.max_lag:
            said.append(
                f"Only lags within ±{result.max_lag:,} samples were searched: allow larger ones where they can occur."
            )
    return said


MAX_LISTED = 5
"""Largest number of arrivals, and of the nearest lags, that are listed."""


def _nearest(result: SignalLag) -> str:
    """Return the lag and the rivals nearest to it in words, and the number of others found."""
    lags = sorted((result.lag, *result.rivals[: MAX_LISTED - 1]))
    return f"The lags {'; '.join(f'{lag:,}' for lag in lags)} and at least {1 + len(result.rivals) - len(lags)} more"


def _samples(spacing: float) -> str:
    whole = round(spacing)
    return f"{whole:,}" if abs(spacing - whole) < 0.05 or spacing >= 100 else f"{spacing:.1f}"


@typesets
def curve_in_words(result: SignalLag) -> str:
    """Return a description of the lag curve: where it is highest, and whether it has other peaks as high."""
    if result.lags is None:
        votes = (result.votes or {}).get(result.lag, 0)
        return f"Votes for each lag: most of them, {votes:,}, are for lag {result.lag:,} samples."
    searched = f"Correlation at the lags {result.lags[0]:,} to {result.lags[-1]:,} samples"
    over_time = result.over_time
    if over_time is not None and over_time.changes:
        lags = f"{over_time.lowest:,.0f} to {over_time.highest:,.0f}"
        return f"{searched}: the lag changes, which spreads the peak over the lags {lags}."
    if result.verdict == "sure":
        return f"{searched}: one clear peak at {result.lag:,}, score {result.score:.3f}."
    if result.verdict == "ambiguous":
        others = f"{counted(len(result.rivals), 'other peak')} {'is' if len(result.rivals) == 1 else 'are'}"
        return f"{searched}: highest at {result.lag:,}, and {others} about as high."
    if result.judgement.opposite_lag is not None:
        return f"{searched}: no peak, but a clear trough at {result.judgement.opposite_lag:,}."
    return f"{searched}: no peak is beyond chance; the highest point is at {result.lag:,}."


EQUAL_SCORES = 0.005
"""Difference below which scores are reported as equal."""

MAX_SCORES = 5
"""Largest number of scores listed."""

REMARKS: Final[dict[str, str]] = {
    "lower_contrast": ", with lower contrast",
    "higher_contrast": ", with higher contrast",
    "partly_covered": ", partly covered",
    "other_colours": " in these colours",
    "mirrored": ", but its mirror image is there",
    "differs": ", but something similar is there",
}
"""{reason of a verdict: words added to "Found …" or "Not found"}."""

NUMBER_WORDS = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")


def headline(result: TemplateSearch) -> str:
    """Return the result in one line."""
    if result.found:
        best, remark = result.matches[0], REMARKS.get(result.reason, "")
        if result.clear > 1:
            return f"Found at {_counted(result.clear).lower()} places{remark}"
        posed = "" if _is_upright(best) else f", {_pose(best)}"
        if is_cut_off(result):
            remark = ", partly outside the image"
        return f"Found at row {best.row}, column {best.col}{posed}{remark}"
    if result.reason == "look_alikes":
        scores = [one.score for one in result.look_alikes]
        if scores[0] - scores[-1] < EQUAL_SCORES:
            return f"{_counted(len(scores))} places fit equally well"
        listed = " ".join(f"{score:.3f}" for score in scores[:MAX_SCORES])
        return f"{_counted(len(scores))} look-alikes: {listed}{' …' if len(scores) > MAX_SCORES else ''}"
    return f"Not found{REMARKS.get(result.reason, '')}"


def is_cut_off(result: TemplateSearch) -> bool:
    """Return whether the best match is partly outside the image, where there are no scores."""
    if not result.found or result.score_map is None:
        return False
    row, col = result.matches[0].row, result.matches[0].col
    return min(row, col) < 0 or row >= result.score_map.shape[0] or col >= result.score_map.shape[1]


def remark_on(match: TemplateMatch) -> str:
    """Return a sentence on how a match differs from the template; "" if it does not."""
    differing = sum(not agrees for line in match.blocks for agrees in line)
    blocks = f"{differing} of {sum(map(len, match.blocks))} blocks"
    if match.kind in ("lower_contrast", "higher_contrast") and match.contrast is not None:
        return f"It has {match.contrast:.2f} × the template’s contrast."
    return {
        "partly_covered": f"{blocks} are covered or missing in the image; all others agree.",
        "other_colours": "The shape is the same, but no light on the template gives these colours.",
        "differs": f"It differs from the template in {blocks}.",
        "not_there": f"It differs from the template in {blocks}.",
    }.get(match.kind or "", "")


def place(match: TemplateMatch) -> str:
    """Return the position and score of a match, and its size and angle if they differ from the template's."""
    posed = "" if _is_upright(match) else f", {_pose(match)}"
    return f"row {match.row}, column {match.col}, score {match.score:.3f}{posed}"


def _is_upright(match: TemplateMatch) -> bool:
    return (match.scale, match.rotation) == (1.0, 0.0)


def _pose(match: TemplateMatch) -> str:
    way = "counter-clockwise" if match.rotation > 0 else "clockwise"
    turned = f"turned {abs(match.rotation):.1f}° {way}" if match.rotation else "upright"
    return f"{match.scale:.2f} × its size, {turned}"


def _counted(number: int) -> str:
    return NUMBER_WORDS[number] if number < len(NUMBER_WORDS) else f"{number}"


def doubtful(result: TemplateSearch) -> list[TemplateMatch]:
    """Return the places to frame if the template is not found: the look-alikes, or the best place."""
    if result.found or result.best is None:
        return []
    return result.look_alikes or [result.best]


def framed_in_words(result: TemplateSearch) -> str:
    """Return a text alternative for the framed image."""
    framed = [place(match) for match in (result.matches[: result.clear] or doubtful(result))[:MAX_SCORES]]
    text = f"The image: {headline(result)}."
    return f"{text} Framed{'' if result.found else ', dashed'}: {'; '.join(framed)}." if framed else text


REASON_WORDS = {
    Reason.MEASURED: "measured",
    Reason.FILLED: "filled in",
    Reason.OUT_OF_FRAME: "out of frame",
    Reason.LOW_TEXTURE: "too little texture",
    Reason.AMBIGUOUS: "ambiguous",
    Reason.LEFT_RIGHT: "left and right disagree",
    Reason.SPECKLE: "speckle",
    Reason.AT_SEARCH_EDGE: "at the edge of the search",
}


@typesets
def blanks_in_words(reason: ReasonMap) -> str:
    """Return the share of a map without a measurement in words, by reason, the most frequent first."""
    shares = {cause: float(np.mean(reason == cause)) for cause in Reason if cause is not Reason.MEASURED}
    found = sorted(((share, cause) for cause, share in shares.items() if share), reverse=True)
    if not found:
        return "every pixel is measured"
    said = ", ".join(f"{REASON_WORDS[cause]} {100 * share:.1f} %" for share, cause in found)
    return f"{100 * sum(shares.values()):.1f} % without a measurement: {said}"
