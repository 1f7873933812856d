"""What every test may ask for: the real data, where this machine has it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

PROJECT = Path(__file__).resolve().parents[1]

# Before NumPy is imported: its threads wait for each other with the processor busy, which the other workers need.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Else every process that a test starts compiles all sources anew, a second each.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# The first example of a compiled loop waits for its machine code, on a busy machine for long; and the same examples in
# every run, so that a failure is the change's.
settings.register_profile("stereolag", deadline=None, derandomize=True)
settings.load_profile("stereolag")


LONGEST_FIRST = ("browser", "package", "app", "core")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the folders whose files take longest: a worker gets a file at a time, and short ones fill the end."""
    places = [PROJECT / "tests" / folder for folder in LONGEST_FIRST]
    items.sort(key=lambda item: next((at for at, place in enumerate(places) if item.path.is_relative_to(place)), -1))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real recordings and pairs with known truth; skip the test where it is absent."""
    folder = Path(os.environ.get("STEREOLAG_DATA", PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the real data are not at {folder} (set STEREOLAG_DATA)")
    return folder
