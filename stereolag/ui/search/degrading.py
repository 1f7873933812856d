"""Damage the image around the template, and see which methods still find it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import streamlit as st

from stereolag.core.jobs import Estimate
from stereolag.figures.templates import trial_jpeg
from stereolag.templates import TemplateSearch, estimate_search
from stereolag.templates.degradation import Degradation, degraded_part, part_shape
from stereolag.templates.opencv import estimate_opencv, is_masked
from stereolag.templates.trials import Trial, try_methods
from stereolag.ui import prose
from stereolag.ui.controls import control
from stereolag.ui.elements import show_jpeg
from stereolag.ui.navigation import fragment
from stereolag.ui.pictures import PictureAndTemplate
from stereolag.ui.results import computed_in_turn
from stereolag.ui.sentences import duration

KEY: Final = "degrade"

NAMES: Final = {"fft": "FFT", "sampled": "Sampled", "opencv": "OpenCV"}

OUTCOME_WORDS: Final = {
    "right": "found",
    "elsewhere": "found elsewhere",
    "missed": "not found",
    "refused": "cannot search here",
}
OUTCOME_MARKS: Final = {
    "right": "green[:material/check_circle:",
    "elsewhere": "orange[:material/wrong_location:",
    "missed": "red[:material/cancel:",
    "refused": "gray[:material/block:",
}


@dataclass(frozen=True, eq=False)
class Survival:
    """The outcome of each method, and a JPEG for each."""

    trials: tuple[Trial, ...]
    fft: bytes
    sampled: bytes
    opencv: bytes


@fragment
def damage_it(inputs: PictureAndTemplate, result: TemplateSearch, min_score: float) -> None:
    """Offer sliders that damage the image around the template, and show the result of each method.

    Parameters
    ----------
    inputs
        The image, the template, and its place if known.
    result
        Gives the place of the template if the true place is unknown.
    min_score
        Minimum score for a method to count as having found the template.
    """
    place = _place(inputs, result)
    if place is None:
        prose.caption("Nothing was found, so there is no place to damage.")
        return
    height, width = inputs.template.shape[:2]
    rows, cols = part_shape(inputs.picture.shape, (height, width))[:2]
    prose.caption(
        f"The sliders change the {cols} × {rows} pixels around the template; only these are searched again, so there "
        "are fewer look-alikes than in a larger image. Thin white: where it is. Bold: where a method found it, with "
        "at least the minimum score."
    )
    degradation = _asked()
    survival = computed_in_turn(
        "degraded search",
        lambda _: _tried(inputs, place, degradation, min_score),
        _estimate(inputs),
        inputs=inputs.digest,
        settings=f"{degradation.model_dump_json()} {place} {min_score}",
        shared=inputs.shared,
        label="Searching the damaged image …",
    )
    if survival is None:
        return
    for column, trial in zip(st.columns(len(NAMES), gap="medium"), survival.trials, strict=True):
        with column:
            prose.markdown(f"**{NAMES[trial.method]}** :{OUTCOME_MARKS[trial.outcome]} {OUTCOME_WORDS[trial.outcome]}]")
            show_jpeg(
                getattr(survival, trial.method),
                f"The damaged image, searched by {NAMES[trial.method]}: {OUTCOME_WORDS[trial.outcome]}.",
            )
            prose.caption(numbers_of(trial))
    prose.markdown(lesson(survival.trials, degradation, min_score))


def _place(inputs: PictureAndTemplate, result: TemplateSearch) -> tuple[int, int] | None:
    if inputs.place is not None or not result.found:
        return inputs.place
    best, (height, width) = result.matches[0], inputs.template.shape[:2]
    # If it was found at another size, keep its centre.
    row, col = best.row + (best.height - height) // 2, best.col + (best.width - width) // 2
    rows, cols = inputs.picture.shape[:2]
    return min(max(row, 0), rows - height), min(max(col, 0), cols - width)


def _asked() -> Degradation:
    values = {}
    columns = st.columns(3, gap="medium")
    for number, name in enumerate(Degradation.model_fields):
        with columns[number // 2]:
            values[name] = control(Degradation, name, key=f"{KEY}.{name}")
    degradation = Degradation(**values)
    st.button(
        "Undo all damage", key=f"{KEY}.undo", on_click=_undo, disabled=degradation == Degradation(), type="tertiary"
    )
    return degradation


def _undo() -> None:
    for name, field in Degradation.model_fields.items():
        st.session_state[f"{KEY}.{name}"] = field.default


def _tried(inputs: PictureAndTemplate, place: tuple[int, int], degradation: Degradation, min_score: float) -> Survival:
    shape = inputs.template.shape[0], inputs.template.shape[1]
    part = degraded_part(inputs.picture, place, shape, degradation)
    here = part.row, part.col
    trials = try_methods(part.pixels, inputs.template, here, mask=inputs.mask, min_score=min_score)
    return Survival(trials, **{trial.method: trial_jpeg(part.pixels, trial, here, shape) for trial in trials})


def _estimate(inputs: PictureAndTemplate) -> Estimate:
    masked = is_masked(inputs.template, inputs.mask)
    shape = part_shape(inputs.picture.shape, (inputs.template.shape[0], inputs.template.shape[1]))
    ours = estimate_search(shape, inputs.template.shape, dtype=inputs.picture.dtype, masked=masked)
    theirs = estimate_opencv(shape, masked)
    return Estimate(max(ours.memory, theirs.memory), ours.seconds + theirs.seconds)


def numbers_of(trial: Trial) -> str:
    """Return the score and the time of a method; for a miss, its best score."""
    if trial.refusal:
        return trial.refusal
    if trial.row is None:
        return f"no place with these exact pixels · {duration(trial.elapsed_s)}"
    best = "best score" if trial.outcome == "missed" else "score"
    return f"{best} {trial.score:.3f} · {duration(trial.elapsed_s)}"


def lesson(trials: tuple[Trial, ...], degradation: Degradation, min_score: float) -> str:
    """Return a sentence or two on why the methods succeeded or failed."""
    of = {trial.method: trial for trial in trials}
    fft, sampled = of["fft"], of["sampled"]
    warped = degradation.turn != 0 or degradation.resize != 1
    if fft.outcome == "refused":
        return fft.refusal
    if fft.outcome == "right" and sampled.outcome == "right":
        if degradation == Degradation():
            return "Nothing is damaged yet. Move a slider until a method loses it."
        return "Enough pixels are exactly as they were: even Sampled finds it."
    if fft.outcome == "right" and sampled.outcome == "refused":
        return "Enough of it is left to compare whole patterns."
    if fft.outcome == "right":
        return (
            "Sampled looks for exact pixel values, and no rare one is left. FFT and OpenCV compare whole patterns: a "
            "uniform change of contrast or brightness costs them nothing while no value is clipped; other damage "
            "lowers the score."
        )
    said = (
        "Another place fits better than the damaged one."
        if fft.outcome == "elsewhere"
        else f"The best score, {fft.score:.3f}, is below the minimum score of {min_score:.2f}."
        if fft.row is not None
        else "Nothing is left to correlate."
    )
    if warped:
        said += " The template is compared as it is: a turned or resized copy no longer lines up with it."
    return said
