"""Controls that the tests move, by their keys in the app."""

from stereolag.stereo.methods import METHODS
from stereolag.ui.controls import exact_key
from stereolag.ui.depth.maps import SHOWN, TAB
from stereolag.ui.depth.view import COLOURS, FOLD, PART
from stereolag.ui.matcher_controls import more_key, preset_key
from stereolag.ui.matcher_controls import more_key as more
from stereolag.ui.matcher_controls import setting_key as setting

__all__ = ["COLOURS", "FOLD", "PART", "SHOWN", "TAB", "exact_key", "more", "preset_key", "setting"]

CUBE = "pair cube"

WINDOW = setting("correlation", "window_size")
OVERLAP = setting("correlation", "overlap")
SEARCH = setting("correlation", "search.kind")
DISPARITIES = setting("correlation", "search.rectified.num_disparities", CUBE)
SMALLEST = setting("correlation", "search.rectified.min_disparity", CUBE)
SEARCH_SIZE = setting("correlation", "search.centred.search_size", CUBE)
REACH = setting("correlation", "search.centred.vertical")
LEFT_RIGHT = setting("correlation", "left_right")
MEDIAN = setting("correlation", "median")

BLOCK = setting("bm", "block_size")
BLOCK_UNIQUENESS = setting("bm", "uniqueness_ratio")

MORE, BLOCK_MORE = more_key("correlation"), more_key("bm")
FOLDS = (*(more_key(method.short_name) for method in METHODS), f"{COLOURS}.opened")
"""Sections of the depth page that are folded away, and not drawn, at first."""
