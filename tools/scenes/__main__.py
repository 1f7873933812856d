"""``python -m tools.scenes [name ...] [--spp N]``: render the sample scenes into ``assets/stereo``."""

import argparse
import json
from importlib import import_module
from pathlib import Path

import cv2
import numpy as np

from .rendering import StereoScene, encode, render, trace

NAMES = ("cube", "fence", "giraffes", "square", "road")
DESTINATION = Path(__file__).parents[2] / "assets" / "stereo"
SEEDS = {"left": 1, "right": 2}


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tools.scenes", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="name", help=f"{', '.join(NAMES)}; all if none")
    parser.add_argument("--spp", type=int, default=256, help="light paths a pixel (default 256)")
    parser.add_argument("--output", type=Path, default=DESTINATION, help="folder to write to")
    arguments = parser.parse_args()
    unknown = set(arguments.names) - set(NAMES)
    if unknown:
        parser.error(f"no scene {', '.join(sorted(unknown))}; there are {', '.join(NAMES)}")
    for name in arguments.names or NAMES:
        description = import_module(f".{name}", __package__).build()
        write(description, arguments.output / name, arguments.spp)


def write(description: StereoScene, folder: Path, spp: int) -> None:
    """Render one scene and write its five files."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = description.load()
    truth = trace(scene, description.camera)
    _write_png(folder / "disparity.png", encode(truth, description.num_disparities))
    _write_png(folder / "occlusion.png", truth.occluded.astype(np.uint8) * 255)
    for eye, seed in SEEDS.items():
        picture = render(scene, description, eye, spp, seed)
        _write_png(folder / f"{eye}.png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    (folder / "calibration.json").write_text(json.dumps(_calibration(description), indent=2) + "\n")
    known = truth.disparity[truth.disparity > 0]
    print(f"{folder}: disparity {known.min():.2f} to {known.max():.2f} px")


def _calibration(description: StereoScene) -> dict[str, float | int | str]:
    camera = description.camera
    cx, cy = camera.principal_point
    return {
        "focal_px": camera.focal_px,
        "baseline_m": camera.baseline_m,
        "doffs_px": 0.0,
        "cx": cx,
        "cy": cy,
        "width": camera.width,
        "height": camera.height,
        "num_disparities": description.num_disparities,
        "title": description.title,
        "description": description.description,
    }


def _write_png(path: Path, image: np.ndarray) -> None:
    if not cv2.imwrite(str(path), image, [cv2.IMWRITE_PNG_COMPRESSION, 9]):
        raise OSError(f"could not write {path}")


if __name__ == "__main__":
    main()
