"""The layers listed in ARCHITECTURE.md: imports only go down, without cycles, and the library imports no UI."""

import ast
import importlib
import importlib.util
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import cv2
import numpy as np
import pytest
from commanded import Command

PACKAGE = Path(__file__).resolve().parents[2] / "stereolag"

ARCHITECTURE, CONTRIBUTING = (
    (PACKAGE.parent / name).read_text(encoding="utf-8") for name in ("ARCHITECTURE.md", "CONTRIBUTING.md")
)

LAYERS: dict[str, float] = {
    package.replace("__init__", "stereolag"): int(layer)
    for layer, packages in re.findall(r"^\| (\d+) \| ([^|]+) \|", ARCHITECTURE, re.MULTILINE)
    for package in re.findall(r"`(?:stereolag/)?(\w+)(?:/|\.py)?`", packages)
}
"""The layer of every package, from the table; a package imports from the layers below and from itself."""

STAGES = (
    ("stereo.matcher",),
    ("stereo.finishing",),
    ("stereo.windows", "stereo.semi_global", "stereo.opencv", "stereo.evaluation", "stereo"),
    ("stereo.methods", "stereo.compiling"),
)
LAYERS |= {name: LAYERS["stereo"] + number / 10 for number, names in enumerate(STAGES) for name in names}
"""Within stereo, the stages are stacked; each method, even a new one, imports those below and no other method."""

LAYERS |= {"figures.pictures": 3}
"""Pictures are lower than the other figures: videos and templates use them as well."""

ALLOWED_BESIDE = {("io", "stereolag")}
"""Exported programs call the public names, so their writer looks them up."""

SCREENS = {"streamlit": ("ui",), "plotly": ("figures", "ui")}


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix("__init__").removesuffix(".")


MODULES = {module_of(path): path for path in PACKAGE.rglob("*.py") if "app" not in path.relative_to(PACKAGE).parts[:1]}


def package_of(module: str) -> str:
    names = (".".join(module.split(".")[:length]) for length in (2, 1))
    package = next((name for name in names if name in LAYERS), None) if module else "stereolag"
    assert package is not None, f"stereolag/{module} stands in no row of ARCHITECTURE.md's table of packages"
    return package


@cache
def imports(module: str) -> frozenset[str]:
    """Return our modules and the third-party packages that a module imports."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(MODULES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(_ours(name) for name in found)


def _ours(name: str) -> str:
    """Return our module that defines a name, or ``other`` and the package for a third-party one."""
    top, _, inner = name.partition(".")
    if top != "stereolag":
        return f"other {top}"
    while inner and inner not in MODULES:
        inner = inner.rpartition(".")[0]
    return inner


def of_ours(module: str) -> set[str]:
    return {name for name in imports(module) if not name.startswith("other ")}


def test_a_package_imports_from_the_layers_below() -> None:
    for module in set(MODULES) - {"stereo"}:
        package = package_of(module)
        for name in of_ours(module) - {"stereo"}:
            other = package_of(name)
            below = LAYERS[other] < LAYERS[package] or other == package
            assert below or (package, other) in ALLOWED_BESIDE, f"{module} imports {name}"


def test_every_package_is_named() -> None:
    packages = {path.parent.relative_to(PACKAGE) for path in PACKAGE.rglob("__init__.py")} - {Path()}
    assert not {path.as_posix() for path in packages if f"{path.name}/`" not in ARCHITECTURE}


@pytest.mark.parametrize("document", [ARCHITECTURE, CONTRIBUTING], ids=["architecture", "contributing"])
def test_every_path_that_is_named_exists(document: str) -> None:
    paths = set(re.findall(r"`([\w./]+(?:/|\.py|\.pyi|\.md|\.js))`", document))
    assert paths
    project = PACKAGE.parent
    missing = {path for path in paths if not any((root / path).exists() for root in (project, PACKAGE))}
    assert not {path for path in missing if not any(PACKAGE.glob(f"**/{path.rstrip('/')}"))}


def test_every_list_that_is_named_exists() -> None:
    lists = re.findall(r"`(\w+)` (?:in|of) `(stereolag/[\w/]+)\.py`", CONTRIBUTING)
    assert lists
    for name, path in lists:
        assert hasattr(importlib.import_module(path.replace("/", ".").removesuffix(".__init__")), name), name
    of_tests = re.findall(r"`([A-Z_]+)`\s(?:in|of)\s+`(tests/[\w/]+\.py)`", CONTRIBUTING)
    assert of_tests
    for name, path in of_tests:
        assert re.search(rf"^{name}\b", (PACKAGE.parent / path).read_text(encoding="utf-8"), re.MULTILINE), name


def test_no_module_leads_back_to_itself() -> None:
    TopologicalSorter({module: of_ours(module) - {""} for module in MODULES}).prepare()  # names a cycle


@pytest.mark.parametrize("screen", SCREENS)
def test_only_the_upper_layers_know_the_screen(screen: str) -> None:
    knowing = {package_of(module) for module in MODULES if f"other {screen}" in imports(module)}
    assert knowing <= set(SCREENS[screen])


@pytest.mark.parametrize(
    ("line", "absent"),
    [
        ("import stereolag", {"numpy", "numba", "cv2"}),
        ("from stereolag import *", {"streamlit", "plotly", "stereolag.figures.notebooks"}),
    ],
)
def test_importing_the_library_brings_in_nothing_before_it_is_used_and_never_a_screen(line, absent):
    code = f"{line}; import sys; sys.exit(', '.join({absent} & set(sys.modules)) or 0)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=PACKAGE.parent)


def test_the_search_command_loads_what_it_searches_with_and_no_more(tmp_path: Path, ran: Command) -> None:
    """Importing the compiler takes longer than a whole search in a script with OpenCV; machine code has its loader."""
    image = np.random.default_rng(0).integers(0, 256, (60, 80, 3), dtype=np.uint8)
    files = {"image.png": image, "template.png": image[20:35, 30:50]}
    for name, pixels in files.items():
        cv2.imwrite(str(tmp_path / name), pixels)
    find = ["find", *(str(tmp_path / name) for name in files), "--json"]
    assert ran(*find).code == 0  # so that no loop has to be compiled by the other process
    code = "import sys; from stereolag.commands import main; assert main(sys.argv[1:]) == 0; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code, *find], cwd=PACKAGE.parent, capture_output=True, text=True, check=True
    )
    loaded = done.stdout.splitlines()[-1].split()
    assert not {name.split(".")[0] for name in loaded} & {*SCREENS, "scipy", "soundfile", "av"}
    assert "numba" not in loaded
    ours = {name.split(".")[1] for name in loaded if name.startswith("stereolag.")}
    assert ours == {"commands", "core", "io", "loops", "templates", "version"}


@pytest.mark.parametrize("folder", ["tools", "benchmarks"])
def test_what_scripts_import_from_the_project_is_there(folder: str) -> None:
    """No type check covers them, and no test runs them all."""
    for path in (PACKAGE.parent / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            module = str(node.module) if isinstance(node, ast.ImportFrom) else ""
            if not module.startswith(("stereolag", "tests.", "benchmarks.")):
                continue
            there = importlib.import_module(module)
            for name in (one.name for one in node.names):
                assert hasattr(there, name) or importlib.util.find_spec(f"{module}.{name}"), (path, module, name)
