"""``stereolag calibrate``: the calibration of a stereo camera from pictures of a board."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stereolag.commands.arguments import DONE, DOUBTFUL, CommandParser, print_result

if TYPE_CHECKING:
    from stereolag.geometry.boards import Board
    from stereolag.geometry.calibrating import StereoCalibration


def run(arguments: Sequence[str]) -> int:
    """Calibrate from the pictures named by the arguments, write and print the result, and return the exit code."""
    parser = CommandParser(
        "calibrate",
        "Calibrate a stereo camera from 8 to 40 pairs of pictures of a chessboard or ChArUco board. Pairs that "
        "contradict the others are left out.",
        "PICTURES [PICTURES ...] --square METRES [--board COLUMNSxROWS] [--out DIR] [--json]",
        f"; {DOUBTFUL} done, but the calibration is doubtful: doubts say why",
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
    options = parser.parse_args(arguments)

    # Imported only now, so that --help does not wait for them.
    from stereolag.geometry.boards import find_boards
    from stereolag.geometry.calibrating import calibrate_boards
    from stereolag.io.pairing import board_pictures

    names, pictures = board_pictures(options.pictures)
    if options.out is not None:
        Path(options.out).mkdir(parents=True, exist_ok=True)
    result = calibrate_boards(find_boards(pictures, options.board), options.square)
    figures = _figures(result, names)
    if options.out is not None:
        figures |= {"out": options.out, "files": _written(options.out, result)}
    print_result(figures, _in_words(figures), as_json=options.json)
    return DOUBTFUL if result.doubts else DONE


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
        "focal_error": result.focal_error,
        "off_grid_m": result.off_grid_m,
        "doubts": result.doubts,
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
        *(f"doubtful: {doubt}" for doubt in figures["doubts"]),
        f"board {columns} × {rows} in {figures['pairs_used']} of {figures['pairs']} pairs of {figures['width']} × "
        f"{figures['height']} px, over {100 * figures['coverage']:.0f} % of the picture",
        f"reprojection error {figures['rms_px']:.3f} px, rows {figures['row_error_px']:.3f} px apart",
        f"focal length {figures['focal_px']:.2f} px, baseline {1000 * figures['baseline_m']:.3f} mm",
    ]
    if figures["off_grid_m"]:
        lines.append(f"corners up to {1000 * figures['off_grid_m']:.2g} mm off the board's grid, taken into account")
    lines += [f"pair {name} is left out: {why.replace('_', ' ')}" for name, why in figures["left_out"].items()]
    if "files" in figures:
        lines.append(f"written to {figures['out']}: {', '.join(figures['files'])}")
    return "\n".join(lines)
