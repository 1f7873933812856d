"""``stereolag sequence``: the depth maps of every frame that a stereo camera took."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from stereolag.commands.flags import SettingsFlags
from stereolag.commands.matchers import add_choice, chosen_matcher, elsewhere, over_known_range, shortcuts_of
from stereolag.commands.pair_flags import add_frames
from stereolag.commands.parsing import DAMAGED, DONE, INTERRUPTED, CommandParser, add_output, one_line, tell
from stereolag.sequences.motion import SequenceSettings
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PresetName

if TYPE_CHECKING:
    from stereolag.commands.sequence_frames import Drive
    from stereolag.sequences import SequenceResult, SequenceState

PRESET: PresetName = "fast"
"""The default preset: it keeps up with the camera."""


def run(arguments: Sequence[str]) -> int:
    """Match the frames named by the arguments, show the progress, and return the exit code."""
    start = chosen_matcher("sequence", arguments, PRESET)
    parser = CommandParser(
        "sequence",
        "Match every frame of a stereo camera. An interrupted run continues where it stopped; a damaged frame is left "
        "out, and tried again by the next run. Flags of single settings depend on the method: to see those of another "
        "one, give --help with its --preset, --method or --settings.",
        "LEFT [RIGHT] --out DIR [--preset NAME] [--calibration FILE] [--video FILE.mp4] [--scheduler ADDRESS|local] "
        "[--json] [settings]",
        f"; {DAMAGED} done, except for damaged frames; {INTERRUPTED} stopped by Ctrl-C",
    )
    add_frames(parser)
    add_output(parser)
    _add_job(parser)
    add_choice(parser, PRESET)
    flags = SettingsFlags(parser, start, shortcuts_of(start), elsewhere)
    over_frames = SettingsFlags(parser, SequenceSettings())
    options, matcher = flags.parsed(arguments)
    beyond = over_frames.parsed(arguments)[1]

    # Imported only now, so that --help does not wait for them.
    from stereolag.commands.sequence_frames import read_drive
    from stereolag.sequences import run_sequence

    drive = read_drive(options)
    matchers = _matchers(over_known_range(matcher, start, options, drive.calibration), options)
    bar = _Bar(hidden=options.json or not sys.stderr.isatty())
    try:
        result = run_sequence(
            drive.sequence,
            matchers,
            options.out,
            calibration=drive.calibration,
            settings=beyond,
            video=options.video,
            disparity_format=options.disparity_format,
            scheduler=options.scheduler,
            again=options.again,
            progress=bar.show,
        )
    except KeyboardInterrupt:
        bar.close()
        print("stereolag sequence: Stopped; the same command continues where it stopped.", file=sys.stderr)
        return INTERRUPTED
    finally:
        bar.close()
    figures = _figures(result, drive, matchers, options)
    tell(figures, _in_words(figures, drive), as_json=options.json)
    for name, problem in result.damaged.items():
        print(f"stereolag sequence: {name}: {one_line(problem)}", file=sys.stderr)
    return DAMAGED if result.damaged else DONE


def _add_job(parser: argparse.ArgumentParser) -> None:
    job = parser.add_argument_group("the job")
    job.add_argument(
        "--compare",
        action="append",
        choices=[kind.short_name for kind in METHODS],
        default=[],
        help="another method beside it, over the same range; may be given several times",
    )
    job.add_argument(
        "--scheduler",
        metavar="ADDRESS|local",
        help="address of a Dask cluster that does the work, tcp://HOST:PORT; local: processes of this machine; unless "
        "given, threads of this process",
    )
    job.add_argument("--again", action="store_true", help="match everything again, also with other settings")


def _matchers(matcher: StereoMatcher, options: argparse.Namespace) -> dict[str, StereoMatcher]:
    """Return the matchers by the names of their folders: the chosen one, and those to compare it with."""
    own = type(matcher).short_name if options.method or options.settings else options.preset or PRESET
    found = {own: matcher}
    searched = matcher.search_range()
    for kind in METHODS:
        if kind.short_name in options.compare:
            other = kind()
            found.setdefault(kind.short_name, other if searched is None else other.with_search_range(*searched))
    return found


class _Bar:
    """A progress bar on one line."""

    def __init__(self, *, hidden: bool) -> None:
        from tqdm import tqdm

        self._bar = tqdm(unit="frame", disable=hidden, dynamic_ncols=True)

    def show(self, state: SequenceState) -> None:
        """Move the bar."""
        if self._bar.total is None:
            self._bar.reset(state.total)
            self._bar.initial = self._bar.n = state.done  # frames finished before must not count towards the speed
        if state.done > self._bar.n:
            self._bar.set_postfix({"damaged": state.damaged} if state.damaged else {}, refresh=False)
            self._bar.update(state.done - self._bar.n)

    def close(self) -> None:
        """Close the bar and leave its line as it is."""
        self._bar.close()


def _figures(
    result: SequenceResult, drive: Drive, matchers: dict[str, StereoMatcher], options: argparse.Namespace
) -> dict[str, Any]:
    return {
        "command": "sequence",
        "frames": result.total,
        "matched": result.matched,
        "finished_before": result.finished_before,
        "damaged": result.damaged,
        "methods": [*matchers],
        "range_px": next(iter(matchers.values())).search_range(),
        "rectified_here": drive.sequence.rectified,
        "elapsed_s": result.elapsed_s,
        "frames_per_second": result.matched / result.elapsed_s if result.elapsed_s else math.nan,
        "out": options.out,
        "video": options.video,
    }


def _in_words(figures: dict[str, Any], drive: Drive) -> str:
    said = (
        f"{figures['matched']:,} of {figures['frames']:,} frames matched in {figures['elapsed_s']:.1f} s, "
        f"{figures['frames_per_second']:.1f} a second"
    )
    if figures["finished_before"]:
        said += f"; {figures['finished_before']:,} were finished before"
    if figures["damaged"]:
        said += f"; {len(figures['damaged']):,} are damaged"
    to = figures["out"] if figures["video"] is None else f"{figures['out']}, {figures['video']}"
    return "\n".join([*drive.said, said, f"written to {to}"])
