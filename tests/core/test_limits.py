"""Limits set in the environment by whoever runs the app."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from stereolag.core import limits as module
from stereolag.core.limits import limits, machine_memory, set_defaults


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


@pytest.mark.parametrize(
    ("joined", "files", "megabytes"),
    [
        ("0::/\n", {"memory.max": "268435456\n"}, 256),  # a container
        ("4:cpu:/\n3:memory:/docker/b7\n", {"memory/memory.limit_in_bytes": "268435456\n"}, 256),  # cgroup version 1
        ("0::/system.slice/app.service\n", {"system.slice/app.service/memory.max": "268435456\n"}, 256),
        (
            "0::/system.slice/app.service\n",
            {"system.slice/app.service/memory.max": "max\n", "system.slice/memory.max": "134217728\n"},
            128,
        ),
        ("0::/app.service\n", {"app.service/memory.max": "max\n", "other.service/memory.max": "1\n"}, None),
        ("1:name=systemd:/app.service\n", {"app.service/memory.max": "1\n"}, None),
        (None, {"memory.max": "1\n"}, None),  # not Linux
    ],
)
def test_a_container_and_a_service_have_the_memory_of_their_groups(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, joined: str | None, files: dict[str, str], megabytes: int | None
) -> None:
    for name, limit in files.items():
        file = tmp_path / "groups" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(limit)
    if joined is not None:
        (tmp_path / "joined").write_text(joined)
    monkeypatch.setattr(module, "_MOUNTED", tmp_path / "groups")
    monkeypatch.setattr(module, "_JOINED", tmp_path / "joined")
    machine_memory.cache_clear()
    try:
        whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
        assert machine_memory() == (whole if megabytes is None else megabytes * 2**20)
        assert limits().job_memory == machine_memory() // 2
    finally:
        machine_memory.cache_clear()
