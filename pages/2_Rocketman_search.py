"""Template search: find a smaller picture in a larger one."""

from typing import Any

import streamlit as st

from stereolag.core.searches import TemplateQuery
from stereolag.figures import templates as figures
from stereolag.templates import TemplateSearch, estimate_search, match_template
from stereolag.ui import prose
from stereolag.ui.controls import control, last_valid
from stereolag.ui.elements import show_picture
from stereolag.ui.navigation import bench, fragment, page, show_parts
from stereolag.ui.results import computed_or_refused, kept_for
from stereolag.ui.search.inputs import TEMPLATE_ADDRESS, PictureAndTemplate, choose_pictures, with_painted_mask
from stereolag.ui.search.parts import (
    damage_it,
    drag_it,
    show_answer,
    show_following,
    show_funnel,
    show_match_files,
    show_opencv_beside,
    show_places,
)
from stereolag.ui.search.sentences import METHODS_FOLLOWING
from stereolag.ui.sentences import TEMPLATE_METHODS, TEMPLATE_METHODS_EXPLAINED

# Fields of the sizes and angles to search, with their default values.
POSES = {name: TemplateQuery.model_fields[name].default for name in ("min_scale", "max_scale", "max_rotation")}
PARTS = {
    "Drag it": drag_it,
    "Places": show_places,
    "Step by step": show_funnel,
    "Damage it": damage_it,
    "Beside OpenCV": show_opencv_beside,
    "Take away": show_match_files,
}


def ask(inputs: PictureAndTemplate | None) -> TemplateQuery | None:
    """Return the query, or None if the settings are refused; without inputs, for a camera, which finds one match."""
    if inputs is not None:
        template = figures.masked_template(inputs.template, inputs.mask)
        show_picture(template, "The template", "Look for this", stretch=False)
    method = control(TemplateQuery, "method", key="template.method", names=TEMPLATE_METHODS)
    prose.caption((TEMPLATE_METHODS_EXPLAINED if inputs is not None else METHODS_FOLLOWING)[method])
    values: dict[str, Any] = {"min_score": control(TemplateQuery, "min_score", key="template.min_score")}
    if inputs is not None:
        values["max_matches"] = control(TemplateQuery, "max_matches", key="template.max_matches")
    values |= ask_poses(possible=method == "fft")
    return last_valid(lambda: TemplateQuery(method=method, **values), "template.query")


def ask_poses(*, possible: bool) -> dict[str, float]:
    """Return the sizes and angles to search; empty if the method handles only the template's own."""
    values: dict[str, float] = {}
    if any(st.session_state.get(f"template.{name}", default) != default for name, default in POSES.items()):
        st.session_state.setdefault("template.poses", True)  # open if the address sets any of them
    with st.expander("Other sizes and angles", icon=":material/rotate_right:", key="template.poses", on_change="rerun"):
        for name in POSES:
            values[name] = control(TemplateQuery, name, key=f"template.{name}", disabled=not possible)
    return values if possible else {}


def search(inputs: PictureAndTemplate, query: TemplateQuery) -> TemplateSearch | None:
    """Return the result of the search, or None while it is running or if it is refused."""
    return computed_or_refused(
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
        **kept_for(inputs, query.model_dump_json()),
        label="Sliding the template over the image …",
    )


@fragment
def find(inputs: PictureAndTemplate) -> None:
    """Draw the controls, compute and show; moving a control reruns only this fragment."""
    controls, result_place = bench()
    with controls:
        inputs = with_painted_mask(inputs)
        query = ask(inputs)
        prose.caption(inputs.description)
    with result_place:
        if query is None:
            return
        TEMPLATE_ADDRESS.write(inputs, {"": query})
        result = search(inputs, query)
        if result is None:
            return
        show_answer(result, query)
        show_parts("template.part", PARTS, inputs, result, query)


@fragment
def follow() -> None:
    """Draw the controls and the camera; a moved control acts on the camera's next frame."""
    controls, result_place = bench()
    with controls:
        query = ask(None)
    with result_place:
        if query is not None:
            TEMPLATE_ADDRESS.write(None, {"": query})
            show_following(query)


with page("Rocketman search"):
    chosen = TEMPLATE_ADDRESS.recalled(choose_pictures)
    if chosen is None:
        follow()
    else:
        find(chosen)
    with st.expander("The source report"):
        prose.markdown(
            "In its maze of 2,446 × 1,526 pixels Rocketman’s top-left corner is at row **528**, column **982**. The "
            "report’s (651, 982) is 123 rows further down: just below his last row, 650. It took 0.49 s with its "
            "sampled NCC and 2.8 s with its FFT."
        )
