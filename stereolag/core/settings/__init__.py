"""Settings: one declaration gives the validation, the control, the flag and the JSON."""

from stereolag.core.settings.fields import (
    Applies,
    Bounds,
    FitsImage,
    Number,
    OfThePair,
    Pixels,
    Usual,
    marker,
    title_of,
)
from stereolag.core.settings.model import Settings, changed, scaled_settings, setting
from stereolag.core.settings.refusals import Problem, SettingsError

__all__ = [
    "Applies",
    "Bounds",
    "FitsImage",
    "Number",
    "OfThePair",
    "Pixels",
    "Problem",
    "Settings",
    "SettingsError",
    "Usual",
    "changed",
    "marker",
    "scaled_settings",
    "setting",
    "title_of",
]
