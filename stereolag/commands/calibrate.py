"""``stereolag calibrate``: the calibration of a stereo camera from pictures of a board.

The pictures are two patterns, a folder, a ZIP, or files matched by their names.
"""

from __future__ import annotations

import argparse
import glob
import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolag.commands.arguments import DONE, CommandParser, add_output, tell
from stereolag.io.sources import Archive, is_archive, read_archive, read_bytes

if TYPE_CHECKING:
    from stereolag.geometry.boards import Board
    from stereolag.geometry.calibrating import StereoCalibration
    from stereolag.io.pairing import PairFiles, PicturesOfFiles


def run(arguments: Sequence[str]) -> int:
    """Calibrate from the pictures named by the arguments, write and print the result, and return the exit code."""
    parser = CommandParser(
        "calibrate",
        "Calibrate a stereo camera from 8 to 40 pairs of pictures of a chessboard or ChArUco board. Pairs that "
        "contradict the others are left out.",
        "PICTURES [PICTURES ...] --square METRES [--board COLUMNSxROWS] [--out DIR] [--json]",
    )
    parser.add_argument(
        "pictures",
        metavar="PICTURES",
        nargs="+",
        help="a folder or ZIP of pairs, or their files, told apart by their names (left01.png and right01.png, or "
        "equal names in folders left and right); or two patterns in quotes, 'left/*.png' 'right/*.png', taken in order",
    )
    parser.add_argument(
        "--board",
        type=_board,
        metavar="COLUMNSxROWS",
        help="inner corners of the board, where four squares meet, as 9x6: 2 to 50 each; detected unless given",
    )
    parser.add_argument(
        "--square", type=_length, required=True, metavar="METRES", help="side of a square, above 0: it sets all lengths"
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="write the calibration to this folder, as stereo.yml (OpenCV), left.yaml and right.yaml (ROS) and "
        "calibration.json; nothing is written unless given",
    )
    add_output(parser)
    options = parser.parse_args(arguments)

    # Imported only now, so that --help does not wait for them.
    from stereolag.geometry.boards import find_boards
    from stereolag.geometry.calibrating import calibrate_boards

    if options.out is not None:
        Path(options.out).mkdir(parents=True, exist_ok=True)
    names, pictures = board_pictures(options.pictures)
    result = calibrate_boards(find_boards(pictures, options.board), options.square)
    figures = _figures(result, names)
    if options.out is not None:
        figures |= {"out": options.out, "files": _written(options.out, result)}
    tell(figures, _in_words(figures), as_json=options.json)
    return DONE


def _board(text: str) -> Board:
    from stereolag.geometry.boards import Board

    found = re.fullmatch(r"(\d{1,3})[x×,](\d{1,3})", text)
    if found is None:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a board; give inner corners as COLUMNSxROWS, for example 9x6"
        )
    try:
        return Board(int(found[1]), int(found[2]))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _length(text: str) -> float:
    try:
        metres = float(text)
    except ValueError:
        metres = -1.0
    if not 0 < metres < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a length; allowed are metres above 0, for example 0.025")
    return metres


def _figures(result: StereoCalibration, names: Sequence[str]) -> dict[str, Any]:
    calibration = result.calibration
    left_out = {name: pair.left_out.value for name, pair in zip(names, result.pairs, strict=True) if pair.left_out}
    return {
        "command": "calibrate",
        "rms_px": result.rms,
        "row_error_px": result.row_error,
        "focal_px": calibration.focal_px,
        "baseline_m": calibration.baseline_m,
        "width": calibration.width,
        "height": calibration.height,
        "board": [result.board.columns, result.board.rows],
        "square_m": result.square_m,
        "pairs": len(names),
        "pairs_used": len(result.used),
        "left_out": left_out,
        "coverage": min(result.left_coverage, result.right_coverage),
    }


def _written(folder: str, result: StereoCalibration) -> list[str]:
    from stereolag.io.calibrations import calibration_json, opencv_calibration, ros_calibration
    from stereolag.io.sources import write_file

    left, right = ros_calibration(result.calibration)
    files = {
        "stereo.yml": opencv_calibration(result.calibration),
        "left.yaml": left,
        "right.yaml": right,
        "calibration.json": calibration_json(result.calibration),
    }
    for name, text in files.items():
        write_file(Path(folder) / name, text.encode())
    return list(files)


def _in_words(figures: dict[str, Any]) -> str:
    columns, rows = figures["board"]
    lines = [
        f"board {columns} × {rows} in {figures['pairs_used']} of {figures['pairs']} pairs of {figures['width']} × "
        f"{figures['height']} px, over {figures['coverage']:.0%} of the picture",
        f"reprojection error {figures['rms_px']:.3f} px, rows {figures['row_error_px']:.3f} px apart",
        f"focal length {figures['focal_px']:.2f} px, baseline {1000 * figures['baseline_m']:.3f} mm",
    ]
    lines += [f"pair {name} is left out: {why.replace('_', ' ')}" for name, why in figures["left_out"].items()]
    if "files" in figures:
        lines.append(f"written to {figures['out']}: {', '.join(figures['files'])}")
    return "\n".join(lines)


# The pictures


def board_pictures(given: Sequence[str]) -> tuple[list[str], PicturesOfFiles]:
    """Return the names of the pairs, and the pairs, decoded on demand.

    Raises
    ------
    ValueError
        No pairs, too many, patterns that match nothing or different numbers of files, or a damaged ZIP.
    OSError
        A file or folder that cannot be read.
    """
    from stereolag.geometry.boards import MOST_PAIRS
    from stereolag.io.pairing import PicturesOfFiles, matched_pairs

    read: Callable[[str], bytes] = partial(read_bytes, what="picture")
    if len(given) == 2 and all(glob.has_magic(text) and not Path(text).exists() for text in given):
        pairs = _in_order(*given)
    else:
        names = [one for text in given for one in _files(text)]
        if len(given) == 1 and Path(given[0]).is_file():
            archive = _archive(given[0])
            names, read = [*archive.names], archive.read
        pairs = matched_pairs(names)
        if not pairs:
            raise ValueError(
                f"No left and right pictures match by name (files given: {len(names)}); name them left01 and right01, "
                "or give two patterns in quotes."
            )
    if len(pairs) > MOST_PAIRS:
        raise ValueError(f"These are {len(pairs)} pairs; at most {MOST_PAIRS} are accepted, and 8 to 40 are enough.")
    return [pair.name for pair in pairs], PicturesOfFiles(pairs, read)


def _in_order(left: str, right: str) -> list[PairFiles]:
    """Return the files of two patterns in pairs, in the order of their numbers."""
    from stereolag.io.pairing import PairFiles

    files = [_matching(pattern) for pattern in (left, right)]
    for pattern, found in zip((left, right), files, strict=True):
        if not found:
            raise ValueError(f"{pattern}: no file matches.")
    if len(files[0]) != len(files[1]):
        raise ValueError(
            f"{left} matches {len(files[0])} files and {right} {len(files[1])}; the numbers must be equal."
        )
    return [PairFiles(Path(one).stem, one, other) for one, other in zip(*files, strict=True)]


def _archive(path: str) -> Archive:
    data = read_bytes(path, "archive")
    if not is_archive(data):
        raise ValueError(f"{path} is one file but not a ZIP; give a folder, a ZIP, or the files of both cameras.")
    return read_archive(data)


def _files(text: str) -> list[str]:
    """Return a file, the pictures in a folder and below it, or the files that match a pattern."""
    from stereolag.io.pairing import PICTURE_ENDINGS

    path = Path(text)
    if path.is_dir():
        found = (one for one in path.rglob("*") if one.suffix.removeprefix(".").lower() in PICTURE_ENDINGS)
        return sorted(str(one) for one in found)
    if path.exists():
        return [text]
    if not (found_by_pattern := _matching(text)):
        raise ValueError(f"{text}: there is no such file or folder.")
    return found_by_pattern


def _matching(pattern: str) -> list[str]:
    """Return the files that match a pattern, in the order of their numbers."""
    from stereolag.io.pairing import natural_order

    return sorted(glob.glob(pattern, recursive=True), key=natural_order)  # noqa: PTH207 (Path's takes none from the root)
