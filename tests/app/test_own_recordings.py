"""The lag page's sentences about a visitor's own recordings: length, rate, channel, and changes made to them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import signal
from streamlit.testing.v1 import AppTest

from stereolag.core.typography import typeset
from tests.app import uploads

SOUND = signal.resample_poly(uploads.noise(2_400), 4, 1)


def said(app: AppTest) -> str:
    return "\n".join(caption.value for caption in app.caption)


def numbers(app: AppTest) -> dict[str, str]:
    return {metric.label: metric.value for metric in app.metric}


@pytest.fixture
def with_recordings(open_page: Callable[..., AppTest]) -> Callable[..., AppTest]:
    def opened(*files: tuple[str, bytes]) -> AppTest:
        app = open_page("pages/1_Sensor_lag.py")
        app.button_group(key="recordings").set_value("own").run()
        for number, (name, data) in enumerate(files, start=1):
            app.file_uploader(key=f"recordings.file_{number}").upload(name, data, "application/octet-stream")
        app.run()
        assert not app.exception
        return app

    return opened


def test_another_rate_is_brought_to_the_lower_and_said(with_recordings: Callable[..., AppTest]) -> None:
    slow = signal.resample_poly(SOUND, 1, 2)
    app = with_recordings(("a.wav", uploads.wav(SOUND[1_000:], 16_000)), ("b.wav", uploads.wav(slow, 8_000)))
    assert not app.error
    assert numbers(app)["Lag, samples"] == "500"
    assert numbers(app)["Time"] == typeset("0.0625 s")
    assert typeset("Sensor 1: 0.5375 s, 4,300 samples, 8,000 Hz, resampled from 16,000 Hz.") in said(app)
    assert typeset("Sensor 2: 0.6 s, 4,800 samples, 8,000 Hz.") in said(app)


def test_an_assumed_rate_is_said_aloud_and_mended_lines_are_counted(with_recordings: Callable[..., AppTest]) -> None:
    lines = uploads.csv(SOUND).split(b"\n")
    lines[7] += b"\0"
    app = with_recordings(("a.csv", b"\n".join(lines)), ("b.csv", uploads.csv(SOUND)))
    assert not app.error
    assert typeset("no rate in the file: 44,100 Hz assumed unless set below, 1 damaged line mended.") in said(app)


def test_the_channel_and_the_limits_are_named(with_recordings: Callable[..., AppTest]) -> None:
    both = np.column_stack((SOUND[100:], SOUND[:-100]))
    app = with_recordings(("both.wav", uploads.wav(both)))
    assert "channel 1 of 2." in said(app)
    assert "channel 2 of 2." in said(app)
    assert typeset("At most 64 MB and 30 million samples per file, over all channels: 11 minutes of one") in said(app)
