"""``stereolag depth``: the depth map of a stereo pair, as figures and as files."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import stereolag as sl
from stereolag.commands.flags import SettingsFlags
from stereolag.commands.matchers import add_choice, chosen_matcher, elsewhere, over_known_range, shortcuts_of
from stereolag.commands.pair_flags import add_pair
from stereolag.commands.parsing import DONE, CommandParser, add_output, tell
from stereolag.core.settings import FitsImage, marker
from stereolag.stereo.matcher import DisparityMap, StereoMatcher

if TYPE_CHECKING:
    from stereolag.commands.depth_pair import DepthPair

FIGURES = ("bad_2_percent", "epe_px", "d1_all_percent", "density", "truth_pixels")
"""Figures of a map with ground truth."""

ROWS_TO_LOAD = 16
"""Rows matched to load the loops, in addition to those of a window."""


def run(arguments: Sequence[str]) -> int:
    """Make the map that the arguments ask for, write and print it, and return the exit code."""
    start = chosen_matcher("depth", arguments)
    parser = CommandParser(
        "depth",
        "Match a rectified stereo pair; with the calibration of both cameras, a raw one too. Flags of single "
        "settings depend on the method: to see those of another one, give --help with its --preset, --method or "
        "--settings.",
        "LEFT RIGHT [--out DIR] [--preset NAME] [--calibration FILE] [--truth FILE] [--json] [settings]",
    )
    add_pair(parser)
    add_output(parser)
    add_choice(parser)
    flags = SettingsFlags(parser, start, shortcuts_of(start), elsewhere)
    options, matcher = flags.parsed(arguments)

    # Imported only now, so that --help does not wait for them.
    from stereolag.commands.depth_files import written_files
    from stereolag.commands.depth_pair import read_pair

    if options.out is not None:
        Path(options.out).mkdir(parents=True, exist_ok=True)
    pair = read_pair(options)
    matcher = over_known_range(matcher, start, options, pair.calibration)

    _load_loops(matcher, pair)
    result = matcher.compute(pair.left, pair.right)
    figures = _figures(pair, result)
    if options.out is not None:
        files, left_out = written_files(options.out, pair, result, far_is_bright=options.preset == "report")
        figures |= {"out": options.out, "files": files, "left_out": left_out}
    tell(figures, _in_words(figures, pair), as_json=options.json)
    return DONE


def _load_loops(matcher: StereoMatcher, pair: DepthPair) -> None:
    """Match a few rows, so that loading or compiling the loops does not count towards the time of the map."""
    sides = [int(value) for name, value in matcher if marker(type(matcher).model_fields[name], FitsImage)]
    rows = max(sides, default=0) + ROWS_TO_LOAD
    with suppress(ValueError):  # the map itself will be refused too
        matcher.compute(pair.left[:rows], pair.right[:rows])


def _figures(pair: DepthPair, result: DisparityMap) -> dict[str, Any]:
    rows, cols = result.disparity.shape
    figures: dict[str, Any] = {
        "command": "depth",
        "width": cols,
        "height": rows,
        "method": type(result.settings).__name__,
        "range_px": result.settings.search_range(),
        "rectified_here": pair.rectified_here,
        "coverage": result.coverage,
        "measured": float((result.valid & ~result.filled).mean()),
        "elapsed_s": result.elapsed_s,
    }
    if pair.truth is not None:
        from stereolag.io.results import figures_of

        judged = figures_of(sl.evaluate(result.disparity, pair.truth))
        figures |= {name: judged[name] for name in FIGURES}
    return figures


def _in_words(figures: dict[str, Any], pair: DepthPair) -> str:
    lines = [*pair.said]
    searched = ""
    if figures["range_px"] is not None:
        first, count = figures["range_px"]
        searched = f", {first} to {first + count - 1} px searched"
    lines.append(
        f"{figures['method']} on {figures['width']} × {figures['height']} px{searched}: {figures['elapsed_s']:.3g} s"
    )
    lines.append(f"disparity for {figures['coverage']:.1%} of the pixels, measured for {figures['measured']:.1%}")
    if pair.truth is not None:
        lines.append(
            f"against the ground truth: bad-2 {figures['bad_2_percent']:.2f} %, EPE {figures['epe_px']:.3f} px, "
            f"D1-all {figures['d1_all_percent']:.2f} %"
        )
    if "files" in figures:
        lines.append(f"written to {figures['out']}: {', '.join(figures['files'])}")
        lines += [f"{name} is left out: {why}" for name, why in figures["left_out"].items()]
    return "\n".join(lines)
