"""The keys of the controls: one place that says under which name a setting is kept in the session."""

from __future__ import annotations

from typing import Final

PAIR: Final = "pairs"
HANDED: Final = f"{PAIR}.handed_over"
"""The pair that another page handed over, in place of files."""
SIZE: Final = f"{PAIR}.size"
FOLD: Final = "depth.head"
FOLD_NEXT: Final = f"{FOLD}.next"
SHOWN: Final = "depth.maps"
TAB: Final = "depth.tab"
PART: Final = "depth.part"
COLOURS: Final = "depth.colours"


def method_key(method: str) -> str:
    """Return what the keys of all settings of a method begin with, by its short name."""
    return f"depth.{method}"


def setting_key(method: str, name: str, source: str | None = None) -> str:
    """Return the key of the control of one setting.

    Parameters
    ----------
    method
        Its short name.
    name
        With dots where the setting lies within another; behind a choice of kinds stands the kind:
        "search.rectified.num_disparities".
    source
        Of a setting that belongs to the pair, the :attr:`stereolag.ui.pairs.StereoPair.searched`.
    """
    key = f"{method_key(method)}.{name}"
    return key if source is None else f"{key}.{source}"


def more_key(method: str) -> str:
    """Return the key of what holds the settings of a method that are folded away at first."""
    return f"{method_key(method)}.more"


def preset_key(name: str) -> str:
    """Return the key of the button of a preset."""
    return f"depth.preset.{name}"


def exact_key(key: str) -> str:
    """Return the key of the box for an exact value beside a slider."""
    return f"{key}.exact"
