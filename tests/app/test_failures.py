"""A failure of the app itself: a sentence with a number for the visitor, the traceback under it in the log."""

import logging

import pytest
import straight_and_raw
import streamlit as st

from stereolag.ui.driving import work
from stereolag.ui.navigation import failures_answered, fragment
from tests.app import driving
from tests.app.pages import page_of


def page() -> None:
    def fail() -> None:
        raise {"memory": MemoryError, "bug": ZeroDivisionError}[st.session_state["kind"]]("/srv/secret/path.py")

    with failures_answered():
        if st.session_state["where"] == "part":
            fragment(fail)()
            st.markdown("after")
        else:
            fail()


@pytest.fixture(autouse=True)
def no_failure_logged() -> None:
    """Allow failures here: these tests cause them."""


@pytest.mark.parametrize("where", ["page", "part"])
@pytest.mark.parametrize(("kind", "says"), [("bug", "Something failed unexpectedly"), ("memory", "enough memory")])
def test_a_failure_is_answered_with_a_sentence_and_a_number(caplog, where, kind, says):
    with caplog.at_level(logging.ERROR, logger="stereolag"):
        app = page_of(page, {"where": where, "kind": kind})
    said = app.error[0].value
    assert says in said
    assert "secret" not in said
    assert "Traceback" not in said
    record = next(record for record in caplog.records if record.name == "stereolag")
    assert record.getMessage().rpartition("number ")[2].rstrip(").") in said
    assert "secret" in str(record.exc_info[1])
    assert bool(app.markdown) == (where == "part")


def test_a_drive_whose_computation_fails_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*given: object, **more: object) -> None:
        raise MemoryError

    monkeypatch.setattr(work, "run_sequence", fail)
    app = driving.finished(driving.opened(driving.archive(straight_and_raw.straight_pair())))
    assert "There is not enough memory left" in app.error[0].value
