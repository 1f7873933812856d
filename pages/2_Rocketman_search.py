"""Template search: find a smaller picture in a larger one."""

import streamlit as st

from stereolag.core.searches import TemplateQuery
from stereolag.figures import templates as figures
from stereolag.templates import estimate_search, match_template
from stereolag.ui import prose
from stereolag.ui.controls import control, last_valid
from stereolag.ui.elements import show_png
from stereolag.ui.inputs import TEMPLATE_ADDRESS, PictureAndTemplate, choose_pictures
from stereolag.ui.navigation import fragment, page
from stereolag.ui.results import computed_or_refused
from stereolag.ui.search.comparison import damage_it, show_opencv_beside
from stereolag.ui.search.panels import search_by_hand, show_funnel
from stereolag.ui.search.result import show_answer, show_match_files, show_scores
from stereolag.ui.sentences import TEMPLATE_METHODS, TEMPLATE_METHODS_EXPLAINED

POSES = {name: TemplateQuery.model_fields[name].default for name in ("min_scale", "max_scale", "max_rotation")}
SEE_WHY = ("Search by hand", "Step by step", "Damage it")


def ask(inputs: PictureAndTemplate) -> TemplateQuery | None:
    """Return the query, or None if the settings are refused."""
    template, controls = st.columns([1, 4], gap="large")
    with template:
        show_png(figures.what_counts(inputs.template, inputs.mask), "The template", "Look for this", stretch=False)
    with controls:
        method = control(TemplateQuery, "method", key="template.method", names=TEMPLATE_METHODS)
        prose.caption(TEMPLATE_METHODS_EXPLAINED[method])
        score, count = st.columns(2, gap="medium")
        with score:
            min_score = control(TemplateQuery, "min_score", key="template.min_score")
        with count:
            max_matches = control(TemplateQuery, "max_matches", key="template.max_matches")
        poses = ask_poses(possible=method == "fft")
    return last_valid(
        lambda: TemplateQuery(method=method, min_score=min_score, max_matches=max_matches, **poses), "template.query"
    )


def ask_poses(*, possible: bool) -> dict[str, float]:
    """Return the sizes and angles to search; empty if the method handles only the template's own."""
    values: dict[str, float] = {}
    if any(st.session_state.get(f"template.{name}", at_first) != at_first for name, at_first in POSES.items()):
        st.session_state.setdefault("template.poses", True)  # shown open when the address sets any of them
    with st.expander("Other sizes and angles", icon=":material/rotate_right:", key="template.poses", on_change="rerun"):
        for name, column in zip(POSES, st.columns(len(POSES), gap="medium"), strict=True):
            with column:
                values[name] = control(TemplateQuery, name, key=f"template.{name}", disabled=not possible)
    return values if possible else {}


@fragment
def find(inputs: PictureAndTemplate) -> None:
    """Draw the controls, compute and show; moving a control reruns only this fragment."""
    query = ask(inputs)
    if query is None:
        return
    TEMPLATE_ADDRESS.write(query, inputs)
    result = computed_or_refused(
        "template search",
        lambda progress: match_template(
            inputs.picture, inputs.template, mask=inputs.mask, **query.arguments, seed=0, progress=progress
        ),
        estimate_search(
            inputs.picture.shape,
            inputs.template.shape,
            dtype=inputs.picture.dtype,
            method=query.method,
            scales=query.arguments["scales"],
            rotations=query.arguments["rotations"],
        ),
        inputs=inputs.digest,
        settings=query.model_dump_json(),
        shared=inputs.shared,
        label="Sliding the template over the image …",
    )
    if result is None:
        return
    show_answer(result, inputs, query)
    show_scores(result, inputs, query)
    show_opencv_beside(inputs, result, query.method)
    show_match_files(inputs, result, query)
    prose.header("See why", anchor="see-why")
    by_hand, steps, damage = st.tabs(SEE_WHY, key="template.see_why", on_change="rerun")
    with by_hand:
        search_by_hand(inputs, result.matches)
    if steps.open:
        with steps:
            show_funnel(inputs)
    if damage.open:
        with damage:
            damage_it(inputs, result, query.min_score)


with page(
    "Rocketman search",
    "Somewhere in the image is a smaller one. Slide it over every place, multiply, add up: where the score peaks, "
    "there it is. It is the same measurement as the lag of two recordings, in two dimensions.",
    "look for him on the moon, where dust has dulled him; then [drag him over the image by hand](#see-why).",
):
    pictures = TEMPLATE_ADDRESS.recalled(choose_pictures)
    prose.caption(pictures.description)
    find(pictures)
    with st.expander("The source report"):
        prose.markdown(
            "In its maze of 2,446 × 1,526 pixels Rocketman’s top-left corner is at row **528**, column **982**. The "
            "report’s (651, 982) is 123 rows further down: just below his last row, 650. It took 0.49 s with its "
            "sampled NCC and 2.8 s with its FFT."
        )
