"""``python -m tools.drive --work FOLDER``: render the frames of the drive that are not there yet."""

import argparse
import time
from pathlib import Path

import cv2
import numpy as np

from .frames import Frame, frame, pack
from .world import FRAMES, build

PARTS = ("left", "right", "disparity", "occlusion", "objects")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.drive", description=__doc__)
    parser.add_argument("--work", type=Path, required=True, help="folder of the frames; finished ones are kept")
    parser.add_argument("--spp", type=int, default=25, help="light paths a pixel, a multiple of 25 (default 25)")
    parser.add_argument("--frames", type=int, nargs="*", metavar="N", help=f"which, of 0 to {FRAMES - 1}; all if none")
    parser.add_argument("--pack", action="store_true", help="write the finished frames into assets/drive instead")
    arguments = parser.parse_args()
    if arguments.pack:
        pack(arguments.work)
        return
    wanted = arguments.frames if arguments.frames else range(FRAMES)
    missing = [number for number in wanted if not _finished(arguments.work, number)]
    if not missing:
        return
    world = build()
    for number in dict.fromkeys(missing):
        begin, worked = time.perf_counter(), time.process_time()
        _write(arguments.work, number, frame(world, number, arguments.spp))
        elapsed, worked = time.perf_counter() - begin, time.process_time() - worked
        print(f"frame {number}: {elapsed:.1f} s, {worked:.1f} s of processor time", flush=True)


def _finished(work: Path, number: int) -> bool:
    return all((work / part / f"{number:06d}.png").is_file() for part in PARTS)


def _write(work: Path, number: int, made: Frame) -> None:
    for part in PARTS:
        image: np.ndarray = getattr(made, part)
        if image.ndim == 3:
            image = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
        path = work / part / f"{number:06d}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_suffix(".part.png")
        if not cv2.imwrite(str(unfinished), image, [cv2.IMWRITE_PNG_COMPRESSION, 9]):
            raise OSError(f"could not write {unfinished}")
        unfinished.replace(path)


if __name__ == "__main__":
    main()
