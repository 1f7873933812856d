"""Arguments common to the commands that match pairs: calibration, rectification, findings and initial settings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from stereolag.assess.diagnosis import Diagnosis
from stereolag.assess.layout import Layout
from stereolag.assess.sentences import finding_in_words
from stereolag.commands.arguments import CommandParser, SettingsFlags, read
from stereolag.geometry.calibration import UNITS, Calibration
from stereolag.io.settings import read_matcher
from stereolag.pair import Pair, Preparation, Rows, prepare
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PRESETS, PresetName, preset

RECTIFY = {"auto": Rows.DECIDE, "yes": Rows.RAW, "no": Rows.RECTIFIED}
"""Values of ``--rectify``: whether the images are to be rectified."""

SHORTCUTS = {"search.num-disparities": "num-disparities", "search.min-disparity": "min-disparity"}
"""Short flags for the range, the same for every method."""


def add_calibration_and_trust(files: argparse._ArgumentGroup, further: str = "") -> None:
    """Add the flags for the calibration of the cameras, and the one that skips the input doctor.

    `further` is added to the help on the calibration.
    """
    files.add_argument(
        "--calibration",
        metavar="FILE",
        nargs="+",
        help=f"calibration of OpenCV, ROS, Kalibr, ZED, OAK, MATLAB, KITTI and others, all files of it{further}",
    )
    files.add_argument(
        "--unit",
        choices=[*UNITS],
        help="unit of the calibration's lengths, if it does not state it (default: m; mm for files of MATLAB)",
    )
    files.add_argument(
        "--rectify",
        choices=[*RECTIFY],
        default="auto",
        help="with a calibration of both cameras: whether the images are raw (default: auto, judged by their rows)",
    )
    files.add_argument(
        "--trust",
        action="store_true",
        help="do not examine the pair beforehand: no range is found for it, and there are no findings",
    )


def requested_calibration(options: argparse.Namespace) -> Calibration | None:
    """Return the calibration named by the flags of `add_calibration_and_trust`, None if they name none.

    Raises
    ------
    ValueError
        Files that are refused, or a unit without them.
    """
    if options.calibration is None:
        if options.unit is not None:
            raise ValueError("--unit is that of a calibration: give --calibration too.")
        return None
    from stereolag.io.calibrations import read_calibration

    return read(read_calibration, *options.calibration, length_unit_m=options.unit and UNITS[options.unit])


def calibration_sentences(calibration: Calibration | None) -> tuple[str, ...]:
    """Return sentences about a calibration: its lengths in metres, and assumptions about it."""
    return () if calibration is None else (calibration.in_words(), *calibration.notes)


def metres_are_doubtful(calibration: Calibration | None, options: argparse.Namespace) -> bool:
    """Return whether a calibration is implausible for a stereo camera, and neither file nor user states its unit."""
    return calibration is not None and not (
        options.trust or options.unit or calibration.plausible or calibration.unit_stated
    )


def add_layout(parser: argparse.ArgumentParser) -> None:
    """Add the flag for the arrangement of both views in one picture."""
    parser.add_argument(
        "--layout",
        choices=[*Layout],
        type=Layout,
        help="how both views stand in LEFT, the left one first (default: found from the picture)",
    )


def findings_as_figures(diagnosis: Diagnosis | None) -> list[dict[str, Any]]:
    """Return the findings that make a map doubtful, for JSON; none if the pair was not examined."""
    return [
        {
            "code": finding.code.value,
            "numbers": dict(finding.numbers),
            "remedy": finding.remedy,
            "sentence": finding_in_words(finding),
        }
        for finding in (() if diagnosis is None else diagnosis.doubts)
    ]


def rectified_as_requested(
    pair: Pair, options: argparse.Namespace, raw: str, done: str, already: str
) -> tuple[Pair, tuple[str, ...]]:
    """Return a pair rectified according to the flags of `add_calibration_and_trust`, and sentences about it.

    Parameters
    ----------
    pair, options
        The pair, and the parsed arguments.
    raw, done, already
        The command's wording for raw images, images that it rectified, and images rectified already.

    Raises
    ------
    ValueError
        Rectification wanted without the cameras it needs, or of images that have a ground truth.
    """
    if options.rectify == "yes" and pair.calibration is not None and pair.calibration.rig is None:
        raise ValueError("The calibration is of a rectified pair: it holds no cameras to rectify with.")
    pair = prepare(pair, Preparation(rows=RECTIFY[options.rectify]))
    decision = pair.rectification
    if decision is None:
        return pair, ()
    rows = decision.evidence
    measured = f"rows differ by {rows.given_px:.2g} px, rectified by {rows.rectified_px:.2g} px"
    why = "as you said" if decision.chosen else measured
    if decision.done and options.truth is not None:
        raise ValueError(
            f"{raw} ({why}) and the ground truth belongs to them before rectification: leave out --truth or "
            "--calibration, or give --rectify no."
        )
    return pair, (f"{done if decision.done else already} ({why}).",)


class MatcherFlags(SettingsFlags[StereoMatcher]):
    """The flags that choose a matcher, and those of its single settings.

    Parameters
    ----------
    parser
        Gets the flags.
    arguments
        Arguments of the command; the flags of single settings depend on the matcher that they choose.
    default_preset
        The preset if they choose none.

    Raises
    ------
    ValueError
        A settings file that is refused.
    """

    def __init__(
        self, parser: CommandParser, arguments: Sequence[str], default_preset: PresetName = "accurate"
    ) -> None:
        choice = CommandParser(parser.command, add_help=False)
        for each in (choice, parser):
            _add_choice(each, default_preset)
        options, _ = choice.parse_known_args(arguments)
        kinds: dict[str | None, type[StereoMatcher]] = {kind.short_name: kind for kind in METHODS}
        if options.settings is not None:
            start = read(read_matcher, options.settings)
        else:
            start = kinds[options.method]() if options.method else preset(options.preset or default_preset)
        super().__init__(
            parser, start, SHORTCUTS if "search" in type(start).model_fields else {}, _methods_with_setting
        )

    def over_known_range(
        self,
        matcher: StereoMatcher,
        options: argparse.Namespace,
        diagnosis: Diagnosis | None,
        known: tuple[int, int] | None,
    ) -> tuple[StereoMatcher, Diagnosis | None]:
        """Return a matcher that searches a known range, unless flags or a settings file set another.

        Parameters
        ----------
        matcher, options
            The parsed settings and arguments.
        diagnosis
            The diagnosis of the pair, returned with its judgement of the range searched; None: not examined.
        known
            First disparity and number of disparities of the calibration, px; None: those that the diagnosis suggests.
        """
        if diagnosis is not None:
            known = known or diagnosis.suggested_range
        initial = self.settings.search_range()
        # Flags may also give the numbers that the settings begin with.
        flags = {name.rpartition(".")[2].replace("_", "-") for name in vars(options)}
        chosen = options.settings is not None or not flags.isdisjoint(SHORTCUTS.values())
        if known is not None and not chosen and initial is not None and matcher.search_range() == initial:
            matcher = matcher.with_search_range(*known)
        return matcher, diagnosis and diagnosis.over(matcher.search_range())


def _add_choice(parser: CommandParser, default_preset: PresetName) -> None:
    sources = parser.add_argument_group(
        "where the settings come from", "One of these; flags of single settings override them."
    ).add_mutually_exclusive_group()
    meanings = " ".join(f"{name}: {preset.meaning}" for name, preset in PRESETS.items())
    sources.add_argument("--preset", choices=[*PRESETS], help=f"{meanings} (default: {default_preset})")
    titles = {kind.short_name: f"{kind.short_name}: {kind.title}" for kind in METHODS}
    sources.add_argument(
        "--method", choices=[*titles], help=f"a method with its own defaults: {'; '.join(titles.values())}"
    )
    sources.add_argument(
        "--settings", metavar="FILE.json", help="settings of a file, as the depth page or --out writes it"
    )


def _methods_with_setting(name: str) -> str:
    """Return a sentence naming the methods that have a setting; "" if none has it."""
    methods = [kind.short_name for kind in METHODS if name in kind.model_fields]
    return f"There is one with --method {' or '.join(methods)}." if methods else ""
