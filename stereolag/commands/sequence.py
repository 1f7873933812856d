"""``stereolag sequence``: the depth maps of every frame that a stereo camera took."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from stereolag.commands.arguments import (
    DONE,
    DOUBTFUL,
    INTERRUPTED,
    CommandParser,
    SettingsFlags,
    one_line,
    print_result,
    read,
)
from stereolag.commands.pairs import (
    MatcherFlags,
    add_calibration_and_trust,
    add_layout,
    calibration_sentences,
    findings_as_figures,
    metres_are_doubtful,
    rectified_as_requested,
    requested_calibration,
)
from stereolag.geometry.calibration import Calibration
from stereolag.geometry.rectification import calibration_for
from stereolag.io.disparities import DISPARITY_FORMATS
from stereolag.pair import Pair, PairId, upright
from stereolag.sequences import SequenceSettings
from stereolag.stereo.matcher import StereoMatcher
from stereolag.stereo.methods import METHODS, PresetName

if TYPE_CHECKING:
    from tqdm import tqdm

    from stereolag.sequences import SequenceState, StereoSequence

WORDING = (
    "The frames are raw",
    "The frames are rectified with their calibration",
    "The frames are rectified already",
)

PRESET: PresetName = "fast"
"""The default preset: it keeps up with the camera."""


def run(arguments: Sequence[str]) -> int:
    """Match the frames named by the arguments, show the progress, and return the exit code."""
    parser = CommandParser(
        "sequence",
        "Match every frame of a stereo camera. An interrupted run continues where it stopped; a damaged frame is left "
        "out, and tried again by the next run. Flags of single settings depend on the method: to see those of another "
        "one, give --help with its --preset, --method or --settings.",
        "LEFT [RIGHT] --out DIR [--preset NAME] [--calibration FILE] [--video FILE.mp4] [--scheduler ADDRESS|local] "
        "[--json] [settings]",
        f"; {DOUBTFUL} done, but for damaged frames, or something is wrong with the pairs or their metres: findings or "
        f"notes say what; {INTERRUPTED} stopped by Ctrl-C",
    )
    _add_frames(parser)
    _add_job(parser)
    flags = MatcherFlags(parser, arguments, PRESET)
    sequence_flags = SettingsFlags(parser, SequenceSettings())
    options, matcher = flags.parsed(arguments)
    sequence_settings = sequence_flags.parsed(arguments)[1]

    # Imported only now, so that --help does not wait for them.
    from tqdm import tqdm

    from stereolag.sequences import diagnose_sequence, run_sequence

    sequence, calibration, notes = _read_sequence(options)
    diagnosis = None if options.trust else diagnose_sequence(sequence)
    count = None if calibration is None else calibration.num_disparities
    matcher, diagnosis = flags.over_known_range(matcher, options, diagnosis, None if count is None else (0, count))
    findings = findings_as_figures(diagnosis)
    sequence = replace(sequence, findings=() if diagnosis is None else diagnosis.doubts)
    matchers = _matchers(matcher, options)
    try:
        with tqdm(unit="frame", disable=options.json or not sys.stderr.isatty(), dynamic_ncols=True) as bar:
            result = run_sequence(
                sequence,
                matchers,
                options.out,
                calibration=calibration,
                settings=sequence_settings,
                video=options.video,
                disparity_format=options.disparity_format,
                scheduler=options.scheduler,
                again=options.again,
                progress=partial(_move, bar),
            )
    except KeyboardInterrupt:
        print("stereolag sequence: Stopped; the same command continues where it stopped.", file=sys.stderr)
        return INTERRUPTED
    figures = {
        "command": "sequence",
        "frames": result.total,
        "matched": result.matched,
        "finished_before": result.finished_before,
        "damaged": result.damaged,
        "methods": [*matchers],
        "range_px": next(iter(matchers.values())).search_range(),
        "rectified_here": sequence.rectified,
        "elapsed_s": result.elapsed_s,
        "frames_per_second": result.matched / result.elapsed_s if result.elapsed_s else math.nan,
        "out": options.out,
        "video": options.video,
        "notes": notes,
        "findings": findings,
    }
    print_result(figures, "\n".join([*notes, *_in_words(figures)]), as_json=options.json)
    for name, problem in result.damaged.items():
        print(f"stereolag sequence: {name}: {one_line(problem)}", file=sys.stderr)
    return DOUBTFUL if result.damaged or findings or metres_are_doubtful(calibration, options) else DONE


def _add_frames(parser: CommandParser) -> None:
    """Add the arguments for the files of a sequence and the output of its maps to a parser."""
    parser.add_argument(
        "left",
        metavar="LEFT",
        help="left pictures, as a folder or a pattern in quotes, or the left video; alone: a folder or "
        "ZIP of both sides, or a video or pictures with both views in each",
    )
    parser.add_argument("right", metavar="RIGHT", nargs="?", help="the same for the right")
    add_layout(parser)
    files = parser.add_argument_group("files")
    files.add_argument(
        "--out",
        metavar="DIR",
        required=True,
        help="write the maps to this folder: METHOD/FRAME.png (disparity × 256 in 16 bits), frames.csv with figures of "
        "every frame, and sequence.json; frames that are finished there are not matched again",
    )
    files.add_argument(
        "--disparity-format",
        choices=[*DISPARITY_FORMATS],
        default=".png",
        help=f"format of the maps; {_formats_in_words()} (default: %(default)s)",
    )
    files.add_argument(
        "--video",
        metavar="FILE.mp4",
        help="write a video of the left pictures beside the maps, in one range of colours",
    )
    files.add_argument("--truth", metavar="FILES", help="a folder or pattern of true disparities to judge the maps by")
    add_calibration_and_trust(files, "; gives the nearest obstacle in metres")
    files.add_argument(
        "--frame-rate",
        type=float,
        metavar="HZ",
        help="frames a second (default: that of the video or of times in the pictures' names; otherwise 10)",
    )


def _formats_in_words() -> str:
    """Return the contents of each format, in words."""
    suffixes: dict[str, list[str]] = {}
    for suffix, kind in DISPARITY_FORMATS.items():
        suffixes.setdefault(kind.holds, []).append(suffix)
    return ", ".join(
        f"{' and '.join(each)}{' hold' if len(each) > 1 else ''} {content}" for content, each in suffixes.items()
    )


def _read_sequence(
    options: argparse.Namespace,
) -> tuple[StereoSequence, Calibration | None, tuple[str, ...]]:
    """Return the frames named by the arguments, their calibration, and sentences about them.

    The first readable frame decides whether they are raw.

    Raises
    ------
    ValueError
        Files that are refused, or that do not belong together.
    OSError
        Files that cannot be opened.
    """
    from stereolag.sequences import open_sequence, rectified_sequence

    # Errors about one of two sides name its files themselves.
    opened = partial(read, open_sequence) if options.right is None else open_sequence
    sequence = opened(
        options.left, options.right, truth=options.truth, frame_rate=options.frame_rate, layout=options.layout
    )
    calibration = requested_calibration(options)
    if calibration is None:
        return sequence, None, sequence.notes
    first = sequence.first_readable()
    if first is None:
        raise ValueError(f"None of the {len(sequence):,} frames can be read: there is nothing to calibrate.")
    fitted = calibration_for(calibration, first.left.shape[1], first.left.shape[0])
    pair = Pair(first.left, first.right, PairId(""), calibration=fitted)
    pair, on_rectification = rectified_as_requested(pair, options, *WORDING)
    sequence = rectified_sequence(sequence, calibration) if pair.rectified_here else replace(sequence, turn=pair.turn)
    notes = (*sequence.notes, *calibration_sentences(pair.calibration), *on_rectification)
    return sequence, upright(pair).calibration, notes


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


def _move(bar: tqdm[Any], state: SequenceState) -> None:
    """Move a progress bar to the state of the job."""
    if bar.total is None:
        bar.reset(state.total)
        bar.initial = bar.n = state.done  # frames finished before do not count towards the speed
    if state.done > bar.n:
        bar.set_postfix({"damaged": state.damaged} if state.damaged else {}, refresh=False)
        bar.update(state.done - bar.n)


def _in_words(figures: dict[str, Any]) -> list[str]:
    before = f"; {figures['finished_before']:,} finished before" if figures["finished_before"] else ""
    damaged = f"; {len(figures['damaged']):,} damaged" if figures["damaged"] else ""
    said = (
        f"{figures['matched']:,} of {figures['frames']:,} frames matched in {figures['elapsed_s']:.1f} s, "
        f"{figures['frames_per_second']:.1f} a second{before}{damaged}"
    )
    to = figures["out"] if figures["video"] is None else f"{figures['out']}, {figures['video']}"
    return [said, f"written to {to}", *(f"doubtful: {finding['sentence']}" for finding in figures["findings"])]
