"""What several tests of the library need."""

import json
from pathlib import Path

import numpy as np
import pytest
from commanded import Command, Ran
from straight_and_raw import DISPARITY, ENTRIES, SIZE, raw_pair, straight_pair

import stereolag as sl
from stereolag.commands import main
from stereolag.io.images import image_png


@pytest.fixture
def ran(capsys: pytest.CaptureFixture[str]) -> Command:
    """Return a function that runs a command as its console script does and returns its exit code and output."""

    def run(*arguments: object) -> Ran:
        try:
            code = main([str(one) for one in arguments])
        except SystemExit as ended:
            code = int(ended.code or 0)
        return Ran(code, *capsys.readouterr())

    return run


@pytest.fixture(scope="session")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with two raw and two rectified frames of one camera, their truth, and the calibration."""
    folder = tmp_path_factory.mktemp("rig")
    entries = {name: np.asarray(one).tolist() for name, one in ENTRIES.items()}
    (folder / "rig.json").write_text(json.dumps(entries))
    (folder / "truth").mkdir()
    for number in range(2):
        sl.write_disparity(folder / "truth" / f"{number}.png", np.full(SIZE[::-1], DISPARITY, np.float32))
    for kind, pair in (("raw", raw_pair()), ("straight", straight_pair())):
        for side, image in zip(("left", "right"), pair, strict=True):
            (folder / kind / side).mkdir(parents=True)
            for number in range(2):
                (folder / kind / side / f"{number}.png").write_bytes(image_png(image))
    return folder
