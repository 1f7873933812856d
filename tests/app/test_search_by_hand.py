from __future__ import annotations

from collections.abc import Callable

import numpy as np
from streamlit.testing.v1 import AppTest

from tests.app.uploads import png, texture
from tests.packed import told

PAGE = "pages/2_Rocketman_search.py"


def test_the_search_page_lets_him_be_searched_by_hand(open_page: Callable[..., AppTest]) -> None:
    app = open_page(PAGE, {"template.see_why": "Step by step"})
    (search,), (score_map,), (funnel,) = (told(app, name) for name in ("template_by_hand", "score_map", "funnel"))
    best = search["leaders"][0]
    assert search["row"] + search["factor"] * best["row"] == 528
    assert search["col"] + search["factor"] * best["col"] == 982
    assert "mean of 4 × 4" in search["words"]["texts"][".hint"]
    assert score_map["name"] == search["name"]
    assert funnel["anchors"][0]["counts"][0] == 3_732_596
    assert funnel["anchors"][0]["best"][:2] == [528, 982]
    app.slider(key="template.min_score").set_value(0.8).run()
    assert told(app, "template_by_hand") == [search]  # painted values stay in the browser
    app.button_group(key="template.method").set_value("sampled").run()
    assert told(app, "score_map") == []
    assert told(app, "template_by_hand") == [search] and told(app, "funnel") == [funnel]


def test_pictures_of_ones_own_can_be_searched_by_hand_too(open_page: Callable[..., AppTest]) -> None:
    app = open_page(PAGE, {"pictures": "own", "template.see_why": "Step by step"})
    scene = texture(120, 180)
    uploads = {"pictures.picture": scene, "pictures.template": scene[30:60, 70:110]}
    for key, picture in uploads.items():
        app.file_uploader(key=key).upload(f"{key}.png", png(picture), "image/png")
    app.run()
    assert not app.exception
    (search,) = told(app, "template_by_hand")
    assert (search["factor"], search["leaders"][0]["row"], search["leaders"][0]["col"]) == (1, 30, 70)
    assert told(app, "funnel")[0]["rows"] == 120


def test_types_that_cannot_be_compared_exactly_have_no_funnel(open_page: Callable[..., AppTest]) -> None:
    app = open_page(PAGE, {"pictures": "own", "template.see_why": "Step by step"})
    scene = texture(120, 180)[:, :, 0]
    app.file_uploader(key="pictures.picture").upload("a.png", png(scene.astype(np.uint16) * 256), "image/png")
    app.file_uploader(key="pictures.template").upload("b.png", png(scene[30:60, 70:110]), "image/png")
    app.run()
    assert not app.exception
    assert told(app, "funnel") == []
    assert any("cannot search here" in caption.value for caption in app.caption)
    assert told(app, "template_by_hand")
