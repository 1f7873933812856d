from __future__ import annotations

import json

from streamlit.testing.v1 import AppTest

from tests.app.conftest import viewers


def blanks() -> None:
    from stereolag.ui.depth.explaining import show_blanks
    from tests.app.depth_view import small_view

    show_blanks(small_view())


def test_every_method_says_where_and_why_it_is_blank() -> None:
    app = AppTest.from_function(blanks, default_timeout=60).run()
    assert not app.exception
    header = viewers(app)[0]
    assert [picture["title"] for picture in header["pictures"]] == ["Convolution", "StereoBM", "StereoSGBM"]
    words = header["legends"][0]["words"]
    assert {"out of frame", "ambiguous"} <= set(words)
    explained = app.markdown[-1].value
    assert all(f"**{word.capitalize()}**" in explained for word in words)
    bars = json.loads(app.get("plotly_chart")[0].proto.spec)["data"]
    assert [bar["name"] for bar in bars] == words
