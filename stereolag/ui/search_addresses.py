"""The addresses of the lag page and the template search page."""

from __future__ import annotations

from stereolag import samples
from stereolag.core.searches import LagSearch, TemplateQuery
from stereolag.core.settings import SettingsError
from stereolag.core.settings.fields import Bounds
from stereolag.core.settings.refusals import Problem
from stereolag.ui import pictures, recordings
from stereolag.ui.page_address import Choice, SettingsAddress, example_choice
from stereolag.ui.pictures import PictureAndTemplate
from stereolag.ui.recordings import RecordingPair

LARGEST = 10**12
"""Largest sampling rate, samples per second, and largest speed, metres per second."""

_LAG_KEYS = {"method": "lag.method", "sampling_rate": "lag.rate", "speed": "lag.speed", "max_lag": "lag.max"}


def _lag_choices() -> dict[str, Choice]:
    return {"recordings": example_choice(recordings.KEY, samples.recordings())}


def _first_search(pair: RecordingPair) -> LagSearch:
    known = {"sampling_rate": pair.sampling_rate, "speed": pair.speed}
    return LagSearch(**{name: value for name, value in known.items() if value is not None})


def _lag_key(name: str, pair: RecordingPair) -> str:
    """Return the key of a control; all except the method belong to the recordings."""
    key = _LAG_KEYS.get(name, f"lag.{name}")
    return key if name == "method" else f"{key}.{pair.digest}"


def _check_search(search: LagSearch, pair: RecordingPair) -> None:
    """Refuse values that the page's number boxes do not accept, and values too large to draw figures with."""
    if search.max_lag is not None and search.max_lag > pair.longest_lag:
        sentence = f"max_lag is {search.max_lag}; allowed are whole numbers from 0 to {pair.longest_lag} or None."
        raise SettingsError((Problem("max_lag", sentence),))
    for name, value in (("sampling_rate", search.sampling_rate), ("speed", search.speed)):
        low = Bounds.of(LagSearch.model_fields[name]).low
        if low is not None and not low <= value <= LARGEST:
            sentence = f"{name} is {value!r}; on this page allowed are numbers from {low:g} to {LARGEST:,}."
            raise SettingsError((Problem(name, sentence),))


LAG_ADDRESS: SettingsAddress[RecordingPair, LagSearch] = SettingsAddress(
    "lag.address", _lag_choices, _first_search, _lag_key, _check_search
)


def _template_choices() -> dict[str, Choice]:
    return {"picture": example_choice(pictures.KEY, samples.mazes())}


TEMPLATE_ADDRESS: SettingsAddress[PictureAndTemplate, TemplateQuery] = SettingsAddress(
    "template.address",
    _template_choices,
    lambda inputs: TemplateQuery(),
    lambda name, inputs: f"template.{name}",
)
