"""The session-state keys of the controls, defined in one place."""

from __future__ import annotations

import re
from typing import Final

PAIR: Final = "pairs"
HANDED: Final = f"{PAIR}.handed_over"
"""Key of the pair handed over by another page in place of files."""
SIZE: Final = f"{PAIR}.size"
FOLD: Final = "depth.head"
FOLD_NEXT: Final = f"{FOLD}.next"
SHOWN: Final = "depth.maps"
TAB: Final = "depth.tab"
PART: Final = "depth.part"
COLOURS: Final = "depth.colours"


def setting_key(method: str, name: str, source: str | None = None) -> str:
    """Return the key of the control of one setting.

    Parameters
    ----------
    method
        Short name of the method.
    name
        Name of the setting, dotted if nested; the kind follows a choice of kinds: "search.rectified.num_disparities".
    source
        :attr:`stereolag.pair.PairId.searched`, for a setting that belongs to the pair.
    """
    key = f"depth.{method}.{name}"
    return key if source is None else f"{key}.{source}"


def more_key(method: str) -> str:
    """Return the key of the expander with a method's initially hidden settings."""
    return f"depth.{method}.more"


def preset_key(name: str) -> str:
    """Return the key of the button of a preset."""
    return f"depth.preset.{name}"


def class_of(key: str) -> str:
    """Return the class that Streamlit gives to the element with this key."""
    return "st-key-" + re.sub(r"[^\w-]", "-", key, flags=re.ASCII)


def exact_key(key: str) -> str:
    """Return the key of the box for an exact value beside a slider."""
    return f"{key}.exact"
