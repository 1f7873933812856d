from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import pytest

from stereolag import samples

LISTS = (samples.recordings, samples.mazes, samples.stereo_pairs, samples.drives)


@pytest.mark.parametrize("examples", LISTS)
def test_every_example_is_complete(examples):
    found = examples()
    assert found
    for name, example in found.items():
        assert example.name == name
        assert example.title
        assert example.description.endswith(".")
        values = [getattr(example, field.name) for field in fields(example)]
        listed = [value if isinstance(value, tuple) else (value,) for value in values]
        assert all(path.is_file() for paths in listed for path in paths if isinstance(path, Path))


@pytest.mark.parametrize("examples", LISTS)
def test_order_is_stable_and_examples_are_frozen(examples):
    assert list(examples()) == list(examples())
    first = next(iter(examples().values()))
    with pytest.raises(FrozenInstanceError):
        first.name = "other"


def test_the_plain_examples_come_first():
    assert list(samples.recordings()) == ["coast", "harbour"]
    assert list(samples.mazes()) == ["maze", "maze_dulled"]
    assert list(samples.stereo_pairs()) == sorted(samples.stereo_pairs())


@pytest.mark.parametrize("examples", LISTS)
def test_absent_examples_are_named(examples, monkeypatch, tmp_path):
    monkeypatch.setattr(samples, "ASSETS", tmp_path / "assets")
    with pytest.raises(FileNotFoundError, match="bundled examples are not at"):
        examples()
