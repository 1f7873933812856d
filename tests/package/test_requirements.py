"""Every imported package is declared once, in pyproject.toml, and pinned in requirements.txt within its range."""

import ast
import importlib.metadata
import sys
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

PROJECT = Path(__file__).resolve().parents[2]


def declared(*, extras: bool = False) -> dict[str, Requirement]:
    """Return the requirements declared in pyproject.toml by name; with ``extras``, also the optional ones."""
    with (PROJECT / "pyproject.toml").open("rb") as file:
        project = tomllib.load(file)["project"]
    asked = [*project["dependencies"]]
    if extras:
        asked += [one for extra in project["optional-dependencies"].values() for one in extra]
    return {canonicalize_name(requirement.name): requirement for requirement in map(Requirement, asked)}


def pinned(name: str) -> dict[str, Version]:
    """Return the pinned version of each package in a requirements file."""
    lines = (PROJECT / name).read_text(encoding="utf-8").splitlines()
    pins = [line.split("==") for line in lines if line and not line.startswith(("#", "-r "))]
    return {canonicalize_name(package): Version(version) for package, version in pins}


def imported() -> set[str]:
    """Return the top-level names of the third-party modules that the library and the app import."""
    files = [PROJECT / "app.py", *(PROJECT / "pages").glob("*.py"), *(PROJECT / "stereolag").rglob("*.py")]
    modules = set()
    for file in files:
        for statement in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(statement, ast.Import):
                modules |= {alias.name.split(".")[0] for alias in statement.names}
            elif isinstance(statement, ast.ImportFrom) and statement.module and not statement.level:
                modules.add(statement.module.split(".")[0])
    return modules - sys.stdlib_module_names - {"stereolag"}


def test_every_module_that_is_imported_is_declared() -> None:
    providers = importlib.metadata.packages_distributions()
    asked = declared(extras=True)
    missing = {
        module
        for module in imported()
        if not any(canonicalize_name(name) in asked for name in providers.get(module, []))
    }
    assert not missing


def test_what_is_declared_is_pinned_and_nothing_else_within_its_range() -> None:
    pins = pinned("requirements.txt")
    asked = declared()
    assert pins.keys() == asked.keys()
    assert not {name: pins[name] for name, requirement in asked.items() if pins[name] not in requirement.specifier}


def test_pins_are_what_is_tested_here() -> None:
    pins = pinned("requirements.txt") | pinned("requirements-dev.txt")
    installed = {canonicalize_name(one.name): Version(one.version) for one in importlib.metadata.distributions()}
    tested = pins.keys() & installed.keys()
    assert {name: installed[name] for name in tested} == {name: pins[name] for name in tested}
