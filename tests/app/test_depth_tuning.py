"""Sweep and Suggest: jobs in the background of the page, their progress, their results, and when they become void."""

import re
import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from stereolag import CorrelationMatcher, SearchArea, StereoBM, preset
from stereolag.assess.findings import Remedy
from stereolag.assess.judging import Criterion, TuningPair, sweep
from stereolag.assess.suggestion import Outcome, Suggestion
from stereolag.core.jobs import Estimate
from stereolag.core.typography import typeset
from stereolag.figures.maps import sweep_bad, sweep_maps
from stereolag.pair import PairId, Rows
from stereolag.stereo.matcher import DisparityMap, StereoMatcher
from stereolag.ui.background_jobs import Job
from stereolag.ui.depth.preparing import rows_key
from stereolag.ui.depth.state import ADOPTED
from stereolag.ui.depth.tuning import PairJob, begin_job, job_on, show_suggest, show_sweep
from stereolag.ui.depth.view import PAIR, SIZE, DepthView
from tests.app.depth_view import pair_of, part_of_page, part_on_a_set, small_view
from tests.app.pages import uploaded
from tests.app.reading import charts, labelled
from tests.archives import zipped

LIGHT = Estimate(0, 0.0)
SWEEP, SUGGEST = "depth.sweep", "depth.suggest"
BLOCKS = StereoBM(num_disparities=64)


def with_result(view: DepthView, matcher: StereoMatcher) -> DepthView:
    """Return the view with one more map, or one in place of the same method's."""
    return replace(view, results={**view.results, matcher.title: matcher.compute(view.pair.left, view.pair.right)})


def judged_blind() -> DepthView:
    """Return a view without truth, with a map of the method that judges the others."""
    return with_result(small_view(truth=False), preset("accurate"))


def job_of(view: DepthView, asked: StereoMatcher, job: Job[Suggestion]) -> PairJob:
    return PairJob(view.pair.id.judged, asked, job, view.pair.id)


def ended(app: AppTest, key: str) -> AppTest:
    app.session_state[key].job.result()
    return app.run()


def cancel(app: AppTest) -> AppTest:
    return labelled(app.button, "Cancel").click().run()


# Sweep


def sweep_of(*values: str, view: DepthView | None = None) -> AppTest:
    app = part_of_page(show_sweep, view)
    for box, text in zip(app.text_input, values, strict=True):
        box.set_value(text)
    return app.run()


def swept(*values: str, view: DepthView | None = None) -> AppTest:
    return ended(sweep_of(*values, view=view).button[0].click().run(), SWEEP)


@pytest.mark.parametrize(("truth", "named"), [(True, "bad-2"), (False, "estimated bad-2")])
def test_a_sweep_shows_a_map_and_a_figure_for_every_combination(truth: bool, named: str) -> None:
    app = swept("32, 64", "9 15;21", view=small_view(truth=truth))
    assert app.button[0].label == "Sweep 6 combinations"
    maps, bad = charts(app)
    assert maps["data"][0]["type"] == "image"
    assert bad["layout"]["xaxis"]["ticktext"] == ["9", "15", "21"]
    assert bad["layout"]["yaxis"]["ticktext"] == ["32", "64"]
    assert len(maps["data"][1]["text"]) == 6
    assert named in maps["data"][1]["text"][0]
    assert app.session_state[SWEEP].job.result().bad.shape == (2, 3)
    assert f"Right: {named}, %, lower is better." in app.caption[0].value
    assert ("estimated" in app.markdown[0].value) != truth


def test_a_cell_is_taken_over_from_the_list_too_the_best_first_and_other_values_ask_for_another_sweep() -> None:
    app = swept("48, 64", "11, 15")
    for values, shown in (("11", 0), ("15, 11", 2)):
        app.text_input[1].set_value(values).run()
        assert len(charts(app)) == shown
    cells = labelled(app.selectbox, "Use the settings of")
    shares = [float(option.rpartition(": ")[2].removesuffix(" %")) for option in cells.options]
    assert len(shares) == 4
    assert shares == sorted(shares)
    row, col = map(int, re.findall(r" (\d+)[,:]", cells.options[0]))
    cells.set_value(cells.options[0]).run()
    taken = app.session_state[ADOPTED]
    assert (taken.search.num_disparities, taken.window_size) == (row, col)


def test_a_sweep_can_be_called_off_and_keeps_its_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    compute = CorrelationMatcher.compute

    def slowly(*arguments: Any, **options: Any) -> DisparityMap:
        time.sleep(0.1)  # a fast machine would be done before it is called off
        return compute(*arguments, **options)

    monkeypatch.setattr(CorrelationMatcher, "compute", slowly)
    app = sweep_of("32, 48, 64", "9, 11, 13, 15, 17, 19, 21, 23").button[0].click().run()
    assert app.button[0].disabled
    app = ended(cancel(app), SWEEP)
    assert not app.button[0].disabled
    assert not app.session_state[SWEEP].job.result().finished
    assert "stopped before" in app.caption[0].value


def test_maps_of_the_judge_itself_have_no_figure() -> None:
    view = judged_blind()
    app = swept("32, 64", "7, 9", view=replace(view, results={"Semi-global": view.results["Semi-global"]}))
    assert "nothing to judge Semi-global by" in app.markdown[0].value
    (maps,) = charts(app)
    assert "not judged" in maps["data"][1]["text"][0]


def test_values_that_are_none_and_one_setting_against_itself_are_refused() -> None:
    app = part_of_page(show_sweep)
    many = ", ".join(map(str, range(30)))
    for text, said in {"5, wide": "not a list of whole numbers", "": "has 0 values", many: "30 values"}.items():
        app.text_input[0].set_value(text).run()
        assert said in app.error[0].value
        assert not app.button
    app.selectbox[0].set_value("window_size").run()
    assert "two different settings" in app.error[0].value


def test_the_figures_show_holes_and_frames() -> None:
    view = small_view()
    tuning_pair = TuningPair.of(view.pair.left, view.pair.right, view.pair.truth)
    centred = CorrelationMatcher(window_size=9, search=SearchArea.centred(33))
    sheet = sweep(centred, [tuning_pair], rows=("window_size", [9, 41]), cols=("search.search_size", [33, 64]))
    assert np.isnan(sheet.maps[1, 0]).all()
    names = ("Window", "Search area")
    for figure in (sweep_maps(sheet, names, view.colours, (0, 0)), sweep_bad(sheet, names, (0, 0))):
        assert [shape.line.dash for shape in figure.layout.shapes] == ["solid", "dot"]
        assert "does not fit" in figure.data[1].text[2]


# Suggest


def search_of(method: str, view: DepthView | None = None) -> AppTest:
    app = part_of_page(show_suggest, view)
    app.segmented_control[0].set_value(method)
    app.segmented_control[1].set_value(10).run()
    return app.button[0].click().run()


def test_a_search_ends_with_reasons_and_settings_to_use() -> None:
    app = ended(search_of("StereoBM"), SUGGEST)
    found = app.session_state[SUGGEST].job.result()
    change = f"Bad-2 on the whole images: **{found.bad_before:.1f} % → {found.bad:.1f} %**"
    assert typeset(change) in app.success[0].value
    assert list(app.dataframe[0].value.columns) == ["Setting", "Before", "Suggested"]
    assert len(app.dataframe[0].value) == len(found.changes) > 0
    app.button[1].click().run()
    assert app.session_state[ADOPTED] == found.matcher


def found_for_blocks(matcher: StereoBM, outcome: Outcome) -> AppTest:
    """Return the page after a search from StereoBM's defaults has found these settings."""
    found = Suggestion(BLOCKS, matcher, outcome, Criterion.TRUE_BAD_2, 26.8, 30.0)
    job: Job[Suggestion] = Job(lambda job: found, LIGHT)
    job.result()
    app = part_of_page(show_suggest, state={SUGGEST: job_of(small_view(), BLOCKS, job)})
    app.segmented_control[0].set_value("StereoBM").run()
    assert "StereoBM" in app.success[0].value
    return app


def in_use(app: AppTest, matcher: StereoMatcher) -> AppTest:
    app.session_state["view"] = with_result(small_view(), matcher)
    return app.run()


def test_a_result_is_said_only_of_the_settings_asked_about() -> None:
    app = found_for_blocks(BLOCKS, Outcome.AS_GOOD)
    for name, shown in {"Convolution": 0, "StereoSGBM": 0, "StereoBM": 1}.items():
        app.segmented_control[0].set_value(name).run()
        assert len(app.success) == shown, name
    assert not in_use(app, StereoBM(num_disparities=64, block_size=9)).success
    assert in_use(app, BLOCKS).success


def test_a_suggestion_stays_once_it_is_in_use() -> None:
    better = StereoBM(num_disparities=64, block_size=11)
    app = found_for_blocks(better, Outcome.BETTER)
    assert app.button[1].label == "Use these settings"
    app = in_use(app, better)
    assert (app.button[1].label, app.button[1].disabled, len(app.dataframe)) == ("In use", True, 1)


def test_a_search_that_runs_is_seen_and_ended_beside_every_method() -> None:
    end = threading.Event()

    def work(job: Job[Suggestion]) -> Suggestion:
        job.report(0.5)
        job.found(replace(least, matcher=StereoBM(block_size=9)))
        while not (job.cancelled or end.wait(0.001)):
            pass
        return least

    least = Suggestion(StereoBM(), StereoBM(), Outcome.AS_GOOD, Criterion.ESTIMATED_BAD_2, 30.0, 30.0)
    job, view = Job(work, LIGHT), judged_blind()
    try:
        app = part_of_page(show_suggest, view, {SUGGEST: job_of(view, StereoBM(), job)})
        for name in ("Convolution", "Semi-global"):
            app.segmented_control[0].set_value(name).run()
            assert "StereoBM" in app.get("progress")[0].proto.text
            assert len(app.get("image")) == 2  # the map of the best settings so far, beside that of those in use
        cancel(app)
        assert job.cancelled
    finally:
        end.set()


def test_without_ground_truth_it_says_estimated_and_by_what_and_nothing_judges_the_judge() -> None:
    app = search_of("StereoBM", judged_blind())
    assert "**estimated** against the accurate preset" in app.markdown[0].value
    app = ended(app, SUGGEST)
    assert "Estimated bad-2" in app.success[0].value
    app = part_of_page(show_suggest, judged_blind())
    app.segmented_control[0].set_value("Semi-global").run()
    assert "nothing to judge Semi-global by" in app.info[0].value
    assert not app.button


# On a set of pairs


def test_the_small_maps_of_a_sweep_on_a_set_say_of_which_pair_they_are() -> None:
    app = part_on_a_set(show_sweep)
    uploaded(app, "pairs", several=("pairs.zip", zipped(pair_of(1, 5) | pair_of(2, 9))))
    for box, values in zip(app.text_input, ("16", "9, 15"), strict=True):
        box.set_value(values)
    app.run().button(key=f"{SWEEP}.start").click().run()
    app = ended(app, SWEEP)
    assert len(charts(app)) == 2
    assert typeset("Left: the maps of pair 1 of 2.") in app.caption[-1].value
    app.button(key="pairs.step.1").click().run()
    assert typeset("Left: the maps of pair 1 of 2, not the pair in use.") in app.caption[-1].value


def looking(view: DepthView) -> None:
    """Begin a job in the first run."""
    if "begun" not in st.session_state:
        st.session_state["begun"] = True
        begin_job(view.pair.id, "job", None, lambda job: None, LIGHT)
        st.session_state["first"] = st.session_state["job"].job
    st.session_state["there"] = job_on(view.pair.id, "job") is not None


def of_set(number: int, *remedies: Remedy) -> DepthView:
    view = small_view()
    return replace(view, pair=replace(view.pair, id=PairId(f"set {number}", collection="set", remedies=remedies)))


@pytest.mark.parametrize(
    ("view", "state", "there"),
    [
        (of_set(0), {}, True),
        (of_set(1), {}, True),
        (small_view(), {}, False),
        (of_set(0, Remedy.SWAP_SIDES), {}, False),
        (of_set(0), {rows_key(PAIR): Rows.RECTIFIED}, False),
        (of_set(0), {f"{PAIR}.alpha": 0.5}, False),
        (of_set(0), {SIZE: "Full"}, False),
    ],
    ids=["nothing", "step", "another pair", "remedy", "rows", "frame", "size"],
)
def test_another_pair_or_preparation_calls_a_job_off_and_a_step_does_not(view, state, there):
    app = part_of_page(looking, of_set(0))
    for key, value in {"view": view, **state}.items():
        app.session_state[key] = value
    assert app.run().session_state["there"] == there
    assert app.session_state["first"].cancelled != there
