"""What whoever runs the app may set in the environment."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from stereolag import limits as module
from stereolag.limits import limits, machine_memory, set_defaults


@pytest.fixture(autouse=True)
def as_found(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(module, "_defaults", {})
    limits.cache_clear()
    yield
    limits.cache_clear()


def test_one_job_may_take_half_of_the_machine() -> None:
    assert limits().job_memory == machine_memory() // 2
    assert (limits().max_pixels, limits().max_samples) == (50_000_000, 320_000_000)


def test_the_environment_comes_before_the_defaults_of_a_server(monkeypatch: pytest.MonkeyPatch) -> None:
    set_defaults(job_memory_mb=200)
    assert limits().job_memory == 200 * 2**20
    monkeypatch.setenv("STEREOLAG_JOB_MEMORY_MB", "100")
    limits.cache_clear()
    assert limits().job_memory == 100 * 2**20
    monkeypatch.setenv("STEREOLAG_JOB_MEMORY_MB", str(10**9))
    limits.cache_clear()
    assert limits().job_memory == machine_memory() // 2


@pytest.mark.parametrize(
    ("variable", "value", "allowed"),
    [
        ("STEREOLAG_MAX_MEGAPIXELS", "many", "from 4 to 1000"),
        ("STEREOLAG_MAX_MEGAPIXELS", "3", "from 4 to 1000"),
        ("STEREOLAG_MAX_MEGASAMPLES", "0", "from 1 to 10000"),
        ("STEREOLAG_JOB_MEMORY_MB", "8", "from 64"),
    ],
)
def test_a_bad_variable_is_named(monkeypatch: pytest.MonkeyPatch, variable: str, value: str, allowed: str) -> None:
    monkeypatch.setenv(variable, value)
    limits.cache_clear()
    with pytest.raises(ValueError, match=f"{variable} is '{value}'; allowed are whole numbers {allowed}"):
        limits()
