"""Which settings a command begins with: a preset, a method's own, or those of a file."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import stereolag as sl
from stereolag.commands.parsing import CommandParser, read
from stereolag.geometry.calibration import Calibration
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PRESETS, PresetName, preset

PRESET: PresetName = "accurate"
"""Unless another is asked for: nobody waits at a slider here."""

SHORTCUTS = {"search.num-disparities": "num-disparities", "search.min-disparity": "min-disparity"}
"""The range goes by one name, whatever the method."""


def add_choice(parser: CommandParser, otherwise: PresetName = PRESET) -> None:
    """Tell a parser of the flags that say which settings there are to change, unless those of a preset."""
    one = parser.add_argument_group(
        "where the settings come from", "One of these; flags of single settings go on top."
    ).add_mutually_exclusive_group()
    meanings = " ".join(f"{name}: {each.meaning}" for name, each in PRESETS.items())
    one.add_argument("--preset", choices=[*PRESETS], help=f"{meanings} (default: {otherwise})")
    names = [kind.short_name for kind in METHODS]
    titles = "; ".join(f"{kind.short_name}: {kind.title}" for kind in METHODS)
    one.add_argument("--method", choices=names, help=f"a method with its own defaults: {titles}")
    one.add_argument("--settings", metavar="FILE.json", help="those of a file, as the depth page or --out writes it")


def chosen_matcher(command: str, arguments: Sequence[str], otherwise: PresetName = PRESET) -> StereoMatcher:
    """Return the matcher that arguments name, or a preset; flags of its settings are not looked at.

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
    """Return a matcher that searches what the calibration states, unless flags or a settings file say how far.

    Parameters
    ----------
    matcher, start
        With and without what flags say.
    options
        Those of `add_choice`.
    calibration
        None where it is not known.
    """
    known = calibration and calibration.num_disparities
    if known and options.settings is None and matcher.search_range() == start.search_range():
        return matcher.with_search_range(0, known)
    return matcher


def elsewhere(name: str) -> str:
    """Return with which methods there is a setting of a name; "" where there is none."""
    having = [kind.short_name for kind in METHODS if name in kind.model_fields]
    return f"There is one with --method {' or '.join(having)}." if having else ""


def shortcuts_of(matcher: StereoMatcher) -> dict[str, str]:
    """Return the other flags of a matcher's settings."""
    return SHORTCUTS if "search" in type(matcher).model_fields else {}
