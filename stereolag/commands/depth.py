"""``stereolag depth``: the depth map of a stereo pair, as figures and as files."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import stereolag as sl
from stereolag.commands.arguments import DONE, DOUBTFUL, CommandParser, add_frames, print_result, read, read_frames
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
from stereolag.figures.legends import cloud_ply, coloured_png, searched_range
from stereolag.figures.pictures import VIRIDIS
from stereolag.io.arrays import npy
from stereolag.io.depths import DEPTH_FORMATS, MAX_PNG_DEPTH_M, depth_png, depth_tiff, too_far
from stereolag.io.disparities import kitti_png, pfm, read_stored_disparity
from stereolag.io.ground_truth import truth_in_px
from stereolag.io.images import image_file
from stereolag.io.results import figures_of
from stereolag.io.settings import settings_json
from stereolag.io.sources import write_file
from stereolag.loops.compilation import load_loader
from stereolag.pair import ChangeCode, Pair, PairId, assemble_pair, upright
from stereolag.pair_sources import read_views
from stereolag.stereo.compiling import few_rows
from stereolag.stereo.matcher import DisparityMap, StereoMatcher

WORDING = ("The images are raw", "The pair was rectified with its calibration", "The pair is rectified already")

FIGURES = ("bad_2_percent", "epe_px", "d1_all_percent", "density", "truth_pixels")
"""Figures of a map with ground truth."""

WRITTEN_AT_ONCE = 3
"""Files written at a time; most of them only wait for the disk."""


def run(arguments: Sequence[str]) -> int:
    """Make the map that the arguments ask for, write and print it, and return the exit code."""
    parser = CommandParser(
        "depth",
        "Match a rectified stereo pair; with the calibration of both cameras, a raw one too. Flags of single "
        "settings depend on the method: to see those of another one, give --help with its --preset, --method or "
        "--settings.",
        "LEFT [RIGHT] [--out DIR] [--preset NAME] [--calibration FILE] [--depth FILE] [--truth FILE] [--json] "
        "[settings]",
        f"; {DOUBTFUL} done, but something is wrong with the pair or its metres: the findings or notes say what",
    )
    _add_files(parser)
    flags = MatcherFlags(parser, arguments)
    options, matcher = flags.parsed(arguments)

    if options.depth is not None:
        _check_depth(parser, options)
    if options.out is not None:
        Path(options.out).mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(1) as background:  # loading takes as long as reading, and as a diagnosis
        background.submit(load_loader)
        pair, notes = _read_pair(options)
        loaded = background.submit(_load_loops, matcher, pair)
        diagnosis = None if options.trust else sl.diagnose(pair.left, pair.right)
        loaded.result()
    known = None if pair.num_disparities is None else (pair.min_disparity, pair.num_disparities)
    matcher, diagnosis = flags.over_known_range(matcher, options, diagnosis, known)

    result = matcher.compute(pair.left, pair.right).turned(-pair.turn)
    pair = upright(pair)
    figures = _figures(pair, result) | {"notes": notes, "findings": findings_as_figures(diagnosis)}
    if options.depth is not None and pair.calibration is not None:
        sl.write_depth(options.depth, pair.calibration.depth(result.disparity))
        figures["depth"] = str(options.depth)
    if options.out is not None:
        files, left_out = _written(Path(options.out), _files_of(pair, result, far_is_bright=options.preset == "report"))
        figures |= {"out": options.out, "files": files, "left_out": left_out}
    print_result(figures, "\n".join([*notes, *_in_words(figures, pair)]), as_json=options.json)
    return DOUBTFUL if figures["findings"] or metres_are_doubtful(pair.calibration, options) else DONE


def _add_files(parser: CommandParser) -> None:
    """Add the arguments for the files of a pair and the output of its map to a parser."""
    parser.add_argument(
        "left", metavar="LEFT", help="the left image: PNG, JPEG, HEIC, AVIF, WEBP, BMP, TIFF, PPM, PGM or GIF"
    )
    parser.add_argument(
        "right",
        metavar="RIGHT",
        nargs="?",
        help="the right image, of the same size; none if LEFT holds both views: an MPO, a spatial HEIC, JPS or PNS, or "
        "any image with one beside or above the other",
    )
    add_layout(parser)
    add_frames(parser, "the left", "the right image")
    files = parser.add_argument_group("files")
    files.add_argument(
        "--truth",
        metavar="FILE",
        help="ground truth to judge the map by: PFM, EXR, FLO, NPY, NPZ, MAT, PNG, PGM or TIFF",
    )
    files.add_argument(
        "--truth-divisor",
        metavar="NUMBER",
        type=float,
        help="its stored values ÷ this are px, below 0 for the other sign (default: what fits a quick map)",
    )
    add_calibration_and_trust(files)
    files.add_argument(
        "--depth",
        metavar="FILE",
        type=Path,
        help=f"write the depth to this file, for which --calibration is needed: .tif has metres as 32-bit floats, NaN "
        f"where there is none; .png whole millimetres up to {MAX_PNG_DEPTH_M} m in 16 bits, as in ROS, 0 where "
        "there is none. Of a raw pair it is that of the rectified left image",
    )
    files.add_argument(
        "--out",
        metavar="DIR",
        help="write the map to this folder: disparity as .pfm, .npy, _kitti.png (16 bits, × 256) and _coloured.png, "
        "settings.json, with a calibration cloud.ply, depth.tif, depth_mm.png and calibration.json, and of a raw pair "
        "both images as rectified; nothing is written unless given",
    )


def _check_depth(parser: CommandParser, options: argparse.Namespace) -> None:
    """Refuse ``--depth`` for a file of another kind, or without a calibration, before anything is read."""
    if options.depth.suffix.lower() not in DEPTH_FORMATS:
        *others, last = DEPTH_FORMATS
        parser.error(f"--depth is {options.depth}; its name ends in {', '.join(others)} or {last}.")
    if options.calibration is None:
        raise ValueError(
            "Depth in metres needs a calibration: give --calibration with that of the cameras, or with a file "
            '{"focal_px": 1000, "baseline_m": 0.1} for a rectified pair.'
        )


def _read_pair(options: argparse.Namespace) -> tuple[Pair, tuple[str, ...]]:
    """Return the pair named by the arguments, ready for matching, and sentences about its processing.

    Raises
    ------
    ValueError
        Files that are refused, or that do not belong together.
    OSError
        Files that cannot be opened.
    """
    if options.right is None and tuple(options.frames) == (1, 1):
        left, right, divided = read(read_views, options.left, layout=options.layout)
        lines: Sequence[str] = (divided,)
    else:
        if options.layout is not None:
            raise ValueError("--layout is for one file with both views, without RIGHT and --frames.")
        (left, right), _, lines = read_frames((options.left, options.right or options.left), options.frames)
    truth = None
    if options.truth is not None:
        stored = read(read_stored_disparity, options.truth)
        truth, about_truth = truth_in_px(stored, left, right, options.truth_divisor)
        lines = (*lines, *filter(None, (about_truth,)))
    pair = assemble_pair(left, right, truth, requested_calibration(options), id=PairId(options.left))
    pair, on_rectification = rectified_as_requested(pair, options, *WORDING)
    changed = [change.sentence for change in pair.changes if change.code is not ChangeCode.RECTIFIED]
    return pair, (*lines, *calibration_sentences(pair.calibration), *changed, *on_rectification)


def _load_loops(matcher: StereoMatcher, pair: Pair) -> None:
    """Match a few rows, so that loading or compiling the loops does not count towards the time of the map."""
    with suppress(ValueError):  # the map itself will be refused too
        matcher.compute(*few_rows(matcher, pair.left, pair.right))


def _figures(pair: Pair, result: DisparityMap) -> dict[str, Any]:
    rows, cols = result.disparity.shape
    figures: dict[str, Any] = {
        "command": "depth",
        "width": cols,
        "height": rows,
        "method": type(result.settings).__name__,
        "range_px": result.settings.search_range(),
        "rectified_here": pair.rectified_here,
        "coverage": result.coverage,
        "filled": float(result.filled.mean()),
        "elapsed_s": result.elapsed_s,
    }
    if pair.calibration is not None:
        depth = pair.calibration.depth(result.disparity)
        figures |= {"depth_coverage": float(np.isfinite(depth).mean()), "too_far_for_png": too_far(depth)}
    if pair.truth is not None:
        judged = figures_of(sl.evaluate(result.disparity, pair.truth))
        figures |= {name: judged[name] for name in FIGURES}
    return figures


def _in_words(figures: dict[str, Any], pair: Pair) -> list[str]:
    searched = ""
    if figures["range_px"] is not None:
        first, count = figures["range_px"]
        searched = f", {first} to {first + count - 1} px searched"
    lines = [
        f"{figures['method']} on {figures['width']} × {figures['height']} px{searched}: {figures['elapsed_s']:.3g} s",
        f"disparity measured for {100 * figures['coverage']:.1f} % of the pixels, filled in for "
        f"{100 * figures['filled']:.1f} %",
        *(f"doubtful: {finding['sentence']}" for finding in figures["findings"]),
    ]
    if pair.truth is not None:
        lines.append(
            f"against the ground truth: bad-2 {figures['bad_2_percent']:.2f} %, EPE {figures['epe_px']:.3f} px, "
            f"D1-all {figures['d1_all_percent']:.2f} %"
        )
    if "depth" in figures:
        lines.append(f"depth of {100 * figures['depth_coverage']:.1f} % of the pixels written to {figures['depth']}")
    if "files" in figures:
        lines.append(f"written to {figures['out']}: {', '.join(figures['files'])}")
        lines += [f"{name} is left out: {why}" for name, why in figures["left_out"].items()]
    if figures.get("too_far_for_png") and ("files" in figures or figures.get("depth", "").lower().endswith(".png")):
        lines.append(f"{figures['too_far_for_png']:,} pixels are beyond {MAX_PNG_DEPTH_M} m: 0 in a PNG of depth")
    return lines


def _files_of(pair: Pair, result: DisparityMap, *, far_is_bright: bool) -> dict[str, Callable[[], bytes]]:
    """Return functions that make the files of a map, by name: those of the page section "Take it away"."""
    disparity, calibration = result.disparity, pair.calibration
    palette = VIRIDIS[::-1] if far_is_bright else VIRIDIS
    files: dict[str, Callable[[], bytes]] = {
        "disparity.pfm": lambda: pfm(disparity),
        "disparity.npy": lambda: npy(disparity),
        "disparity_kitti.png": lambda: kitti_png(disparity),
    }
    if calibration is not None:
        from stereolag.io.calibrations import calibration_json

        files |= {
            "cloud.ply": lambda: cloud_ply(calibration, disparity, pair.left),
            "depth.tif": lambda: depth_tiff(calibration.depth(disparity)),
            "depth_mm.png": lambda: depth_png(calibration.depth(disparity)),
            "calibration.json": lambda: calibration_json(calibration).encode(),
        }
    files["settings.json"] = lambda: settings_json(result.settings).encode()
    files["disparity_coloured.png"] = lambda: coloured_png(disparity, *searched_range([result]), palette)
    if pair.rectified_here:
        for side, image in (("left", pair.left), ("right", pair.right)):
            name, write = image_file(side, image)
            files[name] = partial(write, image)
    return files


def _written(folder: Path, files: Mapping[str, Callable[[], bytes]]) -> tuple[list[str], dict[str, str]]:
    """Write files into a folder, each whole or not at all.

    Returns
    -------
    names
        Names of the files written.
    left_out
        Error of each format that cannot store the map, by file name.
    """

    def write(name: str) -> str:
        try:
            write_file(folder / name, files[name]())
        except ValueError as error:
            return str(error)
        return ""

    with ThreadPoolExecutor(WRITTEN_AT_ONCE) as writers:
        refused = dict(zip(files, writers.map(write, files), strict=True))
    return [name for name, why in refused.items() if not why], {name: why for name, why in refused.items() if why}
