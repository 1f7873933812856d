from __future__ import annotations

import json

from streamlit.testing.v1 import AppTest


def blanks() -> None:
    from stereolag.ui.depth.blanks import show_blanks
    from tests.app.depth_view import small_view

    show_blanks(small_view())


def test_every_method_says_where_and_why_it_is_blank() -> None:
    app = AppTest.from_function(blanks, default_timeout=60).run()
    assert not app.exception
    content = app.get("bidi_component")[0].proto.bytes
    header = json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])
    assert [picture["title"] for picture in header["pictures"]] == ["Convolution", "StereoBM", "StereoSGBM"]
    words = header["legends"][0]["words"]
    assert {"out of frame", "ambiguous"} <= set(words)
    explained = app.markdown[-1].value
    assert all(f"**{word.capitalize()}**" in explained for word in words)
    bars = json.loads(app.get("plotly_chart")[0].proto.spec)["data"]
    assert [bar["name"] for bar in bars] == words
