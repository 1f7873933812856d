"""Template search: find a smaller picture in a larger one."""

import streamlit as st

from stereolag.core.searches import TemplateQuery
from stereolag.figures import templates as figures
from stereolag.templates import TemplateSearch, estimate_search, match_template
from stereolag.ui import prose
from stereolag.ui.controls import control, last_valid
from stereolag.ui.elements import show_png
from stereolag.ui.navigation import fragment, page
from stereolag.ui.pictures import PictureAndTemplate, choose_pictures
from stereolag.ui.results import computed_in_turn
from stereolag.ui.search.answer import doubtful, drawn_once, show_answer, why_no_score_map
from stereolag.ui.search.by_hand import search_by_hand
from stereolag.ui.search.controls import ask_poses
from stereolag.ui.search.degrading import damage_it
from stereolag.ui.search.files import show_match_files
from stereolag.ui.search.funnel import show_funnel
from stereolag.ui.search.opencv_beside import show_opencv_beside
from stereolag.ui.search.score_map import packed, show_score_map
from stereolag.ui.search_addresses import TEMPLATE_ADDRESS
from stereolag.ui.searches import TEMPLATE_METHODS, TEMPLATE_METHODS_EXPLAINED
from stereolag.ui.states import show_refused

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
        poses = ask_poses(method)
    return last_valid(
        lambda: TemplateQuery(method=method, min_score=min_score, max_matches=max_matches, **poses), "template.query"
    )


def show_scores(result: TemplateSearch, inputs: PictureAndTemplate, query: TemplateQuery) -> None:
    """Show the map of scores, one for every position of the template."""
    score_map = result.score_map
    if score_map is None:
        prose.caption(why_no_score_map(query))
        return
    prose.markdown("### How well it fits at every place")
    scores, legend = st.columns([3, 1], gap="medium")
    with scores:
        marked = result.matches if result.found else doubtful(result)
        show_score_map(drawn_once("score map", lambda: packed(score_map, marked), inputs, query))
    alt = "Colours of the scores: dark at 0, yellow at 1."
    legend.plotly_chart(figures.score_legend(), key="score_legend", config={"displayModeBar": False}, alt=alt)
    legend.caption("Each pixel is the score with the template’s top-left corner there. Grey: nothing to correlate.")


@fragment
def find(inputs: PictureAndTemplate) -> None:
    """Draw the controls, compute and show; moving a control reruns only this fragment."""
    query = ask(inputs)
    if query is None:
        return
    TEMPLATE_ADDRESS.write(query, inputs)
    try:
        result = computed_in_turn(
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
    except ValueError as error:
        show_refused(error)
        return
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
