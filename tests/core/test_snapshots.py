"""Snapshots: a changed, a missing and an unused one fail."""

from pathlib import Path

import pytest

from tests import snapshots
from tests.snapshots import as_written, compare, expected_below

TESTS = Path(__file__).parents[1]


def test_every_snapshot_belongs_to_a_test_and_none_is_missing() -> None:
    found, expected = set(TESTS.rglob("snapshots/*")), expected_below(TESTS)
    if snapshots.REWRITE:
        for unused in found - expected:
            unused.unlink()
        found &= expected
    assert found == expected


def test_a_changed_and_a_missing_text_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place, texts = (
        tmp_path / "snapshots" / "lag.verdict.txt",
        {"sure": "Sensor 2, 3\N{NO-BREAK SPACE}m", "both": ["a", "b"]},
    )
    monkeypatch.setattr(snapshots, "REWRITE", False)
    with pytest.raises(AssertionError, match="there is no"):
        compare(place, texts)
    monkeypatch.setattr(snapshots, "REWRITE", True)
    compare(place, texts)
    monkeypatch.setattr(snapshots, "REWRITE", False)
    compare(place, texts)
    assert place.read_text() == as_written(texts) == "sure\n    Sensor 2, 3⍽m\n\nboth\n    a\n    b\n"
    with pytest.raises(AssertionError, match="differs"):
        compare(place, texts | {"sure": "Sensor 1"})
