"""The criterion for judging settings on a pair, and sentences about the results."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from stereolag.assess.judging import Criterion, TuningPair, Unjudged
from stereolag.assess.suggestion import Outcome, Suggestion
from stereolag.core.arrays import FloatMap
from stereolag.core.settings import Settings
from stereolag.ui.jobs import Job
from stereolag.ui.pairs import StereoPair
from stereolag.ui.sentences import percent

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


JUDGE_LEFT_OUT = "Semi-global is not in the table: the accurate preset is Semi-global, and would judge itself."


def estimates_in_words(measured: float) -> str:
    """Return the basis of estimated figures: the accurate preset, and the share of the pixels that it measured."""
    return (
        "There is no ground truth, so these figures are **estimates**: every method is compared on the "
        f"{percent(measured)} of the pixels that the accurate preset measured. They rank the methods; pixels hidden "
        "from one camera are not judged, so the true share of wrong pixels is higher."
    )


def bad_2(criterion: Criterion, *, first: bool = False) -> str:
    """Return the name of the figure; capitalised if it comes `first` in a sentence."""
    name = "bad-2" if criterion is Criterion.TRUE_BAD_2 else "estimated bad-2"
    return name[0].upper() + name[1:] if first else name


def suggestion_in_words(found: Suggestion) -> str:
    """Return the outcome of a search for settings, with its figures."""
    if isinstance(found.outcome, Unjudged):
        return UNJUDGED[found.outcome]
    ended = "" if found.finished else " The search was ended before it had tried everything."
    method, name, tried = found.start.title, bad_2(found.criterion, first=True), found.tried
    if found.outcome is Outcome.AS_GOOD and found.finished and not found.tried:
        return f"{method} has no other settings to try over this range. {name}: **{found.bad_before:.1f} %**."
    if found.outcome is Outcome.AS_GOOD:
        as_good = f"Your {method} settings are as good: none of the {tried} tried is clearly better."
        return f"{as_good} {name}: **{found.bad_before:.1f} %**.{ended}"
    change = f"{found.bad_before:.1f} % → {found.bad:.1f} %"
    return f"The best of {tried} tried for {method}. {name} on the whole images: **{change}**.{ended}"


def search_so_far(found: Suggestion) -> str:
    """Return the progress of a search for settings."""
    yours = f"{found.start.title}: {found.tried} tried. Yours: {bad_2(found.criterion)} {found.bad_before:.1f} %."
    if not found.trials:
        return yours
    gain = max(0.0, *(trial.gain for trial in found.trials))
    return f"{yours} The best so far: {gain:.1f} points less."


def sweep_in_words(criterion: Criterion, *, judged: bool, finished: bool, of: str = "") -> str:
    """Return the caption of a sweep; `of` names the pair that the maps show, if there are several."""
    ended = "" if finished else " The sweep was ended before it had tried everything."
    if not judged:
        whose = f"The maps are of {of}. " if of else ""
        return f"{whose}Dotted frame: the settings in use.{ended}"
    figure = f"{bad_2(criterion)}, %, lower is better"
    maps = f"the maps of {of}" if of else "the maps"
    return f"Left: {maps}. Right: {figure}. Solid frame: the best. Dotted frame: the settings in use.{ended}"


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


def known_truth(pair: StereoPair) -> FloatMap | None:
    """Return the ground truth of a pair; None if it is not known for any pixel."""
    return pair.truth if pair.truth is not None and np.isfinite(pair.truth).any() else None


def criterion_on(pair: StereoPair) -> Criterion:
    """Return the criterion by which settings are judged on a pair."""
    return Criterion.ESTIMATED_BAD_2 if known_truth(pair) is None else Criterion.TRUE_BAD_2


def tuning_pairs(
    pairs: Iterable[StereoPair], search_range: tuple[int, int] | None, job: Job[Any]
) -> Iterator[TuningPair]:
    """Yield the pairs for judging settings within a job, each with its truth or a reference."""
    for pair in pairs:
        yield TuningPair.of(
            pair.left,
            pair.right,
            known_truth(pair),
            search_range=search_range,
            progress=lambda _: job.report_or_end(job.progress),
        )
