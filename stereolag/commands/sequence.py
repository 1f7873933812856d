"""``stereolag sequence``: the depth maps of every frame that a stereo camera took."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stereolag.sequences import SequenceResult, SequenceState
    from stereolag.stereo.matcher import StereoMatcher

DONE, REFUSED, USAGE, DAMAGED, CANCELLED = 0, 1, 2, 4, 130
"""What the command ends with: all frames have maps; nothing was done; wrong flags; some frames are damaged; stopped."""

DESCRIPTION = "Depth maps of a sequence: LEFT and RIGHT are folders, patterns or videos; LEFT alone a ZIP or one video."
EPILOGUE = f"""Written: OUT/METHOD/FRAME.png (disparity x 256, 16 bits), OUT/frames.csv, OUT/sequence.json. A run that
was interrupted goes on where it stopped. Exit codes: {DONE} all frames done, {REFUSED} refused or failed, {USAGE} wrong
flags, {DAMAGED} done but for damaged frames, {CANCELLED} stopped by Ctrl-C."""


def sequence(
    left: str,
    right: str | None = None,
    *,
    out: Path,
    preset: str = "fast",
    num_disparities: int = 64,
    min_disparity: int = 0,
    settings: Path | None = None,
    compare: Sequence[str] = (),
    calibration: Sequence[Path] = (),
    truth: str | None = None,
    video: Path | None = None,
    frame_rate: float | None = None,
    disparity_format: str = ".png",
    scheduler: str | None = None,
    again: bool = False,
    as_json: bool = False,
) -> int:
    """Match all frames of a sequence, tell how far it is, and return the code to exit with.

    Parameters
    ----------
    left, right, truth, frame_rate
        As :func:`stereolag.sequences.open_sequence` takes them.
    out, video, disparity_format, scheduler, again
        As :func:`stereolag.sequences.run_sequence` takes them.
    preset, num_disparities, min_disparity
        As :func:`stereolag.preset` takes them; passed over with `settings`.
    settings
        The JSON of a matcher, as the page writes it.
    compare
        Names of OpenCV's methods to show beside it: "bm", "sgbm".
    calibration
        The files of the camera's calibration.
    as_json
        Print one line of JSON at the end instead of sentences.
    """
    from stereolag.reading import read_calibration
    from stereolag.sequences import open_sequence, run_sequence

    bar = _Bar(hidden=as_json or not sys.stderr.isatty())
    try:
        matchers = _matchers(preset, num_disparities, min_disparity, settings, compare)
        result = run_sequence(
            open_sequence(left, right, truth=truth, frame_rate=frame_rate),
            matchers,
            out,
            calibration=read_calibration(*calibration) if calibration else None,
            video=video,
            disparity_format=disparity_format,
            scheduler=scheduler,
            again=again,
            progress=bar.show,
        )
    except KeyboardInterrupt:
        bar.close()
        print("Stopped; the same command goes on where it was.", file=sys.stderr)
        return CANCELLED
    except (ValueError, OSError) as error:
        bar.close()
        print(_sentence(error), file=sys.stderr)
        return REFUSED
    bar.close()
    print(_json(result) if as_json else _in_words(result, out))
    for name, problem in result.damaged.items():
        print(f"{name}: {problem}", file=sys.stderr)
    return DAMAGED if result.damaged else DONE


def _matchers(
    preset: str, num_disparities: int, min_disparity: int, settings: Path | None, compare: Sequence[str]
) -> dict[str, StereoMatcher]:
    from stereolag.reading import read_matcher
    from stereolag.stereo.methods import METHODS, PRESETS

    if settings is not None:
        own = read_matcher(settings)
        found = {type(own).short_name: own}
    elif preset in PRESETS:
        found = {preset: PRESETS[preset].make(min_disparity, num_disparities)}
    else:
        raise ValueError(f"preset is {preset!r}; allowed are {', '.join(PRESETS)}.")
    known = {method.short_name: method for method in METHODS}
    range_of_own = next(iter(found.values())).search_range() or (min_disparity, num_disparities)
    for name in compare:
        if name not in known:
            raise ValueError(f"compare names {name!r}; allowed are {', '.join(known)}.")
        found.setdefault(name, known[name]().with_search_range(*range_of_own))
    return found


class _Bar:
    """A line that tells how far the job is."""

    def __init__(self, *, hidden: bool) -> None:
        from tqdm import tqdm

        self._bar = tqdm(unit="frame", disable=hidden, dynamic_ncols=True)

    def show(self, state: SequenceState) -> None:
        """Move the bar."""
        if self._bar.total is None:
            self._bar.reset(state.total)
            self._bar.initial = self._bar.n = state.done  # what was finished before tells nothing of the speed
        if state.done > self._bar.n:
            self._bar.set_postfix({"damaged": state.damaged} if state.damaged else {}, refresh=False)
            self._bar.update(state.done - self._bar.n)

    def close(self) -> None:
        """Leave the line as it is."""
        self._bar.close()


def _json(result: SequenceResult) -> str:
    rate = result.matched / result.elapsed_s if result.elapsed_s else math.nan
    return json.dumps(asdict(result) | {"frames_per_second": round(rate, 3)})


def _in_words(result: SequenceResult, out: Path) -> str:
    rate = result.matched / result.elapsed_s
    said = f"{result.matched:,} of {result.total:,} frames matched in {result.elapsed_s:.1f} s, {rate:.1f} a second"
    before = f"; {result.finished_before:,} were finished before" if result.finished_before else ""
    damaged = f"; {len(result.damaged):,} are damaged" if result.damaged else ""
    return f"{said}{before}{damaged}: {out}"


def _sentence(error: ValueError | OSError) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or 'A file'}: {error.strerror}."
    return str(error)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command by itself: ``python -m stereolag.commands.sequence``.

    Parameters
    ----------
    arguments
        Those of the command line unless given.

    Returns
    -------
    int
        The code to exit with.
    """
    parser = argparse.ArgumentParser(
        prog="stereolag sequence", description=DESCRIPTION, epilog=EPILOGUE, allow_abbrev=False
    )
    parser.add_argument("left", metavar="LEFT")
    parser.add_argument("right", metavar="RIGHT", nargs="?")
    parser.add_argument("--out", type=Path, required=True, help="folder that is written to")
    parser.add_argument("--preset", default="fast", help="fast (the default), accurate or report")
    parser.add_argument("--num-disparities", type=int, default=64, help="how many disparities are searched, px; 64")
    parser.add_argument("--min-disparity", type=int, default=0, help="the first one, px; 0")
    parser.add_argument("--settings", type=Path, help="JSON of a matcher, in place of a preset")
    parser.add_argument("--compare", action="append", default=[], help="another method beside it: bm, sgbm, …")
    parser.add_argument("--calibration", type=Path, nargs="+", default=[], help="its files; gives metres")
    parser.add_argument("--truth", help="folder or pattern of true disparities; gives errors")
    parser.add_argument("--video", type=Path, help="MP4 of the left pictures beside the maps")
    parser.add_argument("--frame-rate", type=float, help="Hz; that of the video, or 10")
    parser.add_argument("--disparity-format", default=".png", help=".png (the default), .pfm or .npy")
    parser.add_argument(
        "--scheduler", help='address of a Dask scheduler, or "local"; threads of this process unless given'
    )
    parser.add_argument("--again", action="store_true", help="match everything anew")
    parser.add_argument("--json", action="store_true", dest="as_json", help="print one line of JSON")
    return sequence(**vars(parser.parse_args(arguments)))


if __name__ == "__main__":
    sys.exit(main())
