"""Helpers that open the driving page without a browser, wait for it and read it."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from streamlit.testing.v1 import AppTest

from stereolag.ui.driving.inputs import ONE
from stereolag.ui.driving.work import WORK, DriveWork
from tests.app import uploads
from tests.app.pages import DRIVING, open_page, until
from tests.archives import zipped
from tests.packed import told


def zipped_frames(frames: Mapping[str, Iterable[bytes]]) -> bytes:
    """Return a ZIP of the frames of each side."""
    return zipped({f"{side}/{number:03d}.png": one for side in frames for number, one in enumerate(frames[side])})


def archive(pair: tuple[np.ndarray, np.ndarray], count: int = 2) -> bytes:
    """Return a ZIP of identical frames."""
    return zipped_frames({side: [uploads.png(one)] * count for side, one in zip(("left", "right"), pair, strict=True)})


def page(origin: str) -> AppTest:
    """Return the page with its example or with the file uploader."""
    return open_page(DRIVING, {"driving.origin": origin})


def opened(data: bytes, name: str = "drive.zip") -> AppTest:
    app = page(ONE)
    app.file_uploader(key="driving.one").set_value((name, data, "application/zip")).run()
    return app


def finished(app: AppTest) -> AppTest:
    """Return the page once its computation has ended."""
    until(lambda: not work_of(app).job.running)
    return app.run()


def player(app: AppTest) -> dict[str, Any]:
    """Return the data that the page sends to the player."""
    (shown,) = told(app, "player")
    return shown


def work_of(app: AppTest) -> DriveWork:
    kept: DriveWork = app.session_state[WORK]
    return kept
