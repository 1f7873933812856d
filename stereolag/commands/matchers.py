"""The initial settings of a command: a preset, a method's defaults, or those of a file."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import stereolag as sl
from stereolag.commands.parsing import CommandParser, read
from stereolag.geometry.calibration import Calibration
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PRESETS, PresetName, preset

PRESET: PresetName = "accurate"
"""The default preset: nobody waits at a slider here."""

SHORTCUTS = {"search.num-disparities": "num-disparities", "search.min-disparity": "min-disparity"}
"""Short flags for the range, the same for every method."""


def add_choice(parser: CommandParser, otherwise: PresetName = PRESET) -> None:
    """Add the flags that choose the initial settings to a parser; `otherwise` is the default preset."""
    one = parser.add_argument_group(
        "where the settings come from", "One of these; flags of single settings override them."
    ).add_mutually_exclusive_group()
    meanings = " ".join(f"{name}: {each.meaning}" for name, each in PRESETS.items())
    one.add_argument("--preset", choices=[*PRESETS], help=f"{meanings} (default: {otherwise})")
    names = [kind.short_name for kind in METHODS]
    titles = "; ".join(f"{kind.short_name}: {kind.title}" for kind in METHODS)
    one.add_argument("--method", choices=names, help=f"a method with its own defaults: {titles}")
    one.add_argument("--settings", metavar="FILE.json", help="settings of a file, as the depth page or --out writes it")


def chosen_matcher(command: str, arguments: Sequence[str], otherwise: PresetName = PRESET) -> StereoMatcher:
    """Return the matcher named by the arguments, or a preset; flags of its settings are ignored.

    Raises
    ------
    ValueError
        A settings file that is refused.
    """
    parser = CommandParser(command, add_help=False)
    add_choice(parser)
    options, _ = parser.parse_known_args(arguments)
    if options.settings is not None:
        return read(sl.read_matcher, options.settings)
    for kind in METHODS:
        if kind.short_name == options.method:
            return kind()
    name: PresetName = options.preset or otherwise
    return preset(name)


def over_known_range(
    matcher: StereoMatcher, start: StereoMatcher, options: argparse.Namespace, calibration: Calibration | None
) -> StereoMatcher:
    """Return a matcher that searches the range stated by the calibration, unless flags or a settings file set it.

    Parameters
    ----------
    matcher, start
        The matcher with and without the changes made by flags.
    options
        Those of `add_choice`.
    calibration
        None if unknown.
    """
    known = calibration and calibration.num_disparities
    if known and options.settings is None and matcher.search_range() == start.search_range():
        return matcher.with_search_range(0, known)
    return matcher


def elsewhere(name: str) -> str:
    """Return a sentence naming the methods that have a setting; "" if none has it."""
    having = [kind.short_name for kind in METHODS if name in kind.model_fields]
    return f"There is one with --method {' or '.join(having)}." if having else ""


def shortcuts_of(matcher: StereoMatcher) -> dict[str, str]:
    """Return the short flags of a matcher's settings."""
    return SHORTCUTS if "search" in type(matcher).model_fields else {}
