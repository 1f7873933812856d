"""README, docs/, docstrings: links, includes and names are valid, programs and examples run, figures are measured."""

import ast
import doctest
import importlib
import inspect
import io
import re
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from commanded import Command
from PIL import Image
from straight_and_raw import RIG, T

import stereolag as sl
from stereolag.assess.findings import FindingCode
from stereolag.core.settings import changed
from stereolag.geometry.boards import Board
from stereolag.geometry.drawn_boards import drawn_pairs
from stereolag.samples import mazes, recordings

PROJECT = Path(__file__).resolve().parents[2]
DOCS = PROJECT / "docs"
PAGES = sorted(page for page in DOCS.rglob("*.md") if not {"_build", "generated"} & set(page.parts))
README = (PROJECT / "README.md").read_text(encoding="utf-8")
SCREENS = DOCS / "screens"
FRAMES = 2

INCLUDE = re.compile(r"^```\{include\} (\S+)", re.MULTILINE)
ROLE = re.compile(r"\{py:(\w+)\}`(?:[^`<]*<)?~?([\w.]+)>?`")
PICTURE = re.compile(
    r'<picture><source media="\(prefers-color-scheme: dark\)" srcset="([^"]+)">\n'
    r'<img alt="([^"]+)" src="([^"]+)" width="830"></picture>'
)


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def own(name: str) -> str:
    return text_of(DOCS / name)


def headings(page: Path) -> set[str]:
    """Return the anchors of a page and its included files, as MyST names them."""
    texts = [text_of(page), *(text_of(page.parent / name) for name in INCLUDE.findall(text_of(page)))]
    titles = [title for text in texts for title in re.findall(r"^#+ (.+)$", text, re.MULTILINE)]
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@cache
def defined_in(module: str) -> frozenset[str]:
    """Return the functions and classes defined in a module of ours; OSError if there is no such module."""
    place = PROJECT / module.replace(".", "/")
    file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    body = ast.parse(text_of(file)).body
    kinds = (ast.FunctionDef, ast.ClassDef)
    return frozenset(node.name for node in body if isinstance(node, kinds))


@pytest.mark.parametrize("page", [*PAGES, PROJECT / "README.md"], ids=lambda page: page.relative_to(PROJECT).as_posix())
def test_links_lead_to_what_is_there_also_those_of_included_files(page: Path) -> None:
    for name in INCLUDE.findall(text_of(page)):
        file = page.parent / name
        for target in re.findall(r"\]\((?!https?:|#)([^)#\s]+)", text_of(file)):
            assert (file.parent / target).is_file(), f"{name}: {target}"
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", text_of(page)):
        name, _, anchor = target.partition("#")
        led_to = page.parent / name if name else page
        assert led_to.is_file(), target
        assert not anchor or anchor in headings(led_to), target


def test_pictures_are_there_and_say_what_they_show() -> None:
    shown = []
    for page in PAGES:
        for name, options in re.findall(r"```\{figure\} (\S+)\n((?::.*\n)*)", text_of(page)):
            shown.append((page.parent / name).resolve())
            assert shown[-1].is_file(), name
            assert re.search(r"^:alt: .{30,}\.$", options, re.MULTILINE), name
    assert sorted(shown) == sorted([*(DOCS / "pictures").iterdir(), *(DOCS / "screens").iterdir()])


def test_the_contents_hold_every_page_once() -> None:
    listed = []
    for page in PAGES:
        for block in re.findall(r"```\{toctree\}\n(.*?)```", text_of(page), re.DOTALL):
            lines = [line for line in block.splitlines() if line and not line.startswith(":")]
            listed += [(page.parent / f"{line}.md").relative_to(DOCS).as_posix() for line in lines]
    assert sorted([*listed, "index.md"]) == sorted(page.relative_to(DOCS).as_posix() for page in PAGES)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_what_pages_name_is_in_the_code(page: Path) -> None:
    for kind, name in ROLE.findall(text_of(page)):
        if kind == "mod":
            defined_in(name)
        else:
            assert name.startswith("stereolag.")
            thing: object = sl
            for part in name.split(".")[1:]:
                thing = getattr(thing, part)
    for function, module in re.findall(r"`(\w+)` in\s+\{py:mod\}`([\w.]+)`", text_of(page)):
        assert function in defined_in(module), f"{module}.{function}"
    for path in re.findall(r"`((?:stereolag|benchmarks|assets|deployment)/[\w./]*)`", text_of(page)):
        assert (PROJECT / path).exists(), path


def test_the_reference_lists_every_public_name_once_and_the_page_of_modules_those_that_pages_name() -> None:
    listed = re.findall(r"^   stereolag\.(\w+)$", own("reference.md"), re.MULTILINE)
    assert sorted(listed) == sorted(set(sl.__all__) - {"__version__"})
    sequences = ast.parse(text_of(PROJECT / "stereolag/sequences/__init__.py"))
    offered = {alias.name for node in sequences.body if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert set(re.findall(r"^   stereolag\.sequences\.(\w+)$", own("reference.md"), re.MULTILINE)) <= offered
    named = {name for page in PAGES for kind, name in ROLE.findall(text_of(page)) if kind == "mod"}
    assert re.findall(r"^   (stereolag\.[\w.]+)$", own("modules.md"), re.MULTILINE) == sorted(named)


def test_tables_tell_every_reason_every_finding_of_the_doctor_and_every_benchmark() -> None:
    told = re.findall(r"^\| `([A-Z_]+)` \|", own("method/finishing.md"), re.MULTILINE)
    assert told == [reason.name for reason in sl.Reason]
    rows = re.findall(r"^\| (`[a-z_`, ]+) \|", own("own_camera.md"), re.MULTILINE)
    assert [code.strip("`") for row in rows for code in row.split(", ")] == [code.value for code in FindingCode]
    tables = set()
    for node in ast.parse(text_of(PROJECT / "benchmarks/__main__.py")).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in ("DEFAULT_TABLES", "TABLES"):
            tables |= {part.value for part in ast.walk(node) if isinstance(part, ast.Constant)}
    assert set(re.findall(r"^\| `(\w+)` \|", own("measurements.md"), re.MULTILINE)) == tables


def test_the_errata_are_what_the_examples_hold() -> None:
    errata, coast, maze = own("errata.md"), recordings()["coast"], mazes()["maze"]
    assert f"{coast.lag / coast.sampling_rate * coast.speed:.2f} m: {coast.lag:,} samples" in errata
    assert f"{sl.read_signal(coast.signal_1).channels[0].size:,}" in errata
    height = sl.read_image(maze.template).shape[0]
    assert f"row {maze.row}, column {maze.col}; {maze.row + height} is where he ends, {height} rows below" in errata
    rows, cols = sl.read_image(maze.picture).shape[:2]
    assert f"{cols} × {rows} px" in errata


@pytest.mark.parametrize("page", sorted((DOCS / "method").glob("[!i]*.md")), ids=lambda page: page.stem)
def test_the_examples_of_the_method_give_what_they_show(page: Path) -> None:
    tried = doctest.testfile(str(page), module_relative=False, encoding="utf-8")
    assert tried.attempted > 2
    assert not tried.failed


def test_the_program_of_the_first_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", own("index.md"), re.DOTALL)
    exec(program, {})
    assert capsys.readouterr().out.startswith("(480, 640) ")


def test_the_program_for_an_own_camera_runs_from_raw_pictures_to_metres(tmp_path, monkeypatch, capsys):
    (program,) = re.findall(r"```python\n(.*?)```", own("own_camera.md"), re.DOTALL)
    for number, pair in enumerate(drawn_pairs(RIG.scaled(1.25), Board(9, 6), 6, square_m=0.025, seed=3)):
        for side, picture in zip(("left", "right"), pair, strict=True):
            (tmp_path / "boards" / side).mkdir(parents=True, exist_ok=True)
            (tmp_path / "scene").mkdir(exist_ok=True)
            cv2.imwrite(str(tmp_path / f"boards/{side}/{number:02}.png"), picture)
            cv2.imwrite(str(tmp_path / f"scene/{side}.png"), picture)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(program, names)
    assert "% measured, " in capsys.readouterr().out
    calibration, depth = names["calibration"], names["depth"]
    assert isinstance(calibration, sl.Calibration)
    assert calibration.baseline_m == pytest.approx(np.linalg.norm(T), rel=0.02)
    assert 0.2 < float(np.nanmedian(np.asarray(depth))) < 5
    assert (tmp_path / "scene/disparity.pfm").is_file()


PROGRAMS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


def commands(page: str) -> list[str]:
    """Return the commands shown on a page, verbatim."""
    text = (PROJECT / page).read_text(encoding="utf-8")
    (block,) = re.findall(r"```\n(stereolag (?!app).*?)```", text, re.DOTALL)
    return block.splitlines()


def test_the_readme_is_read_in_one_go() -> None:
    assert README.count("\n") < 200


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Change to a folder with the examples, including a few frames of the drive, and return it."""
    for example in (PROJECT / "assets").iterdir():
        if example.name != "drive":
            (tmp_path / "assets").mkdir(exist_ok=True)
            (tmp_path / "assets" / example.name).symlink_to(example)
    for side in ("left", "right"):
        here = tmp_path / "assets/drive/motorway" / side
        here.mkdir(parents=True)
        for frame in sorted((PROJECT / "assets/drive/motorway" / side).iterdir())[:FRAMES]:
            (here / frame.name).symlink_to(frame)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_program_of_the_readme_runs(capsys: pytest.CaptureFixture[str]) -> None:
    exec(PROGRAMS[0], {})
    said, complained = capsys.readouterr()
    assert complained == ""
    lag, place, bad, ailments, changes = said.splitlines()
    assert lag.startswith("50082 1.1356")
    assert lag.endswith(" sure")
    assert place.startswith("True 528 982 ")
    windows, accurate, block = map(float, bad.strip("[]").split(", "))
    assert 0 < accurate < windows < block < 30
    assert ailments == "[]"
    assert changes.startswith("{")


def test_the_drive_is_computed(folder: Path) -> None:
    exec(PROGRAMS[1], {"sl": sl})  # it continues the program before it
    assert (folder / "drive.mp4").is_file()
    assert len([*(folder / "maps").rglob("*.png")]) == FRAMES


def test_the_commands_run(folder: Path, ran: Command) -> None:
    shown = commands("README.md")
    assert [line.split()[1] for line in shown] == ["lag", "find", "depth", "sequence", "calibrate"]
    *lines, calibrating = commands("docs/command_line.md")
    assert {*shown} <= {*lines, calibrating}
    said = []
    for line in lines:
        told = ran(*line.split()[1:])
        assert (told.code, told.err) == (0, ""), line
        said.append(told.out)
    assert said[0].startswith("lag       50082 samples")
    assert '"row": 528, "col": 982' in said[1]
    assert said[2].startswith("row 528, column 982, score 1.000")
    assert "bad-2 0." in said[3]
    assert sl.read_matcher(folder / "map/settings.json") == changed(sl.preset("fast"), {"median.radius": 4})
    assert said[-1].startswith(f"{FRAMES} of {FRAMES} frames matched in ")
    refused = ran(*calibrating.split()[1:])
    assert refused.err == "stereolag calibrate: pairs.zip: there is no such file or folder.\n"


def test_every_figure_of_the_readme_is_one_that_was_measured() -> None:
    results = "".join(
        (PROJECT / f"benchmarks/results/{name}.md").read_text("utf-8")
        for name in ("speed", "accuracy", "flow", "sequences")
    )
    measured = {float(number.replace(",", "")) for number in re.findall(r"\d[\d,]*(?:\.\d+)?", results)}
    rows = re.findall(r"^\| (?!task|---).*$", README.partition("\n## Figures\n")[2].partition("\n## ")[0], re.MULTILINE)
    assert len(rows) == 9
    for row in rows:
        _, ours, peer, time, errors = (cell.strip(" *") for cell in row.strip("|").split("|"))
        amounts = re.findall(r"([\d.]+) (ms|s|frames/s)\b", f"{ours}, {peer}")
        assert {float(amount) for amount, _ in amounts} <= measured, row
        if "frames/s" in ours:
            assert float(time) == pytest.approx(float(amounts[1][0]) / float(amounts[0][0]), abs=0.005)
        else:
            assert any(float(time) == pytest.approx(one, rel=0.004) for one in measured), row
        assert not errors or float(errors) in measured, row
        assert ("**" in row) == (float(time) > 1), row


def test_every_picture_of_the_readme_is_there_light_and_dark_and_says_what_it_shows() -> None:
    shown = PICTURE.findall(README)
    assert len(shown) == README.count("<img ") == README.count("<picture>") > 5
    for dark, alternative, light in shown:
        assert dark == light.replace("-light.", "-dark.")
        assert re.fullmatch(r".{40,250}\.", alternative), alternative
        sizes = []
        for name in (light, dark):
            with Image.open(PROJECT / name) as picture:
                sizes.append(picture.size)
                most = 300_000 if getattr(picture, "is_animated", False) else 150_000
            assert (PROJECT / name).stat().st_size < most, name
        assert sizes[0] == sizes[1]
    named = {Path(name).name for dark, _, light in shown for name in (dark, light)}
    assert named == {file.name for file in SCREENS.iterdir()}
    assert sum(file.stat().st_size for file in SCREENS.iterdir()) < 2_000_000


def test_the_links_of_the_readme_into_the_app_lead_to_pages_and_headings() -> None:
    pages = {file.stem.partition("_")[2] for file in (PROJECT / "pages").glob("*.py")}
    sources = [*(PROJECT / "pages").glob("*.py"), *(PROJECT / "stereolag/ui").rglob("*.py")]
    written = {one for file in sources for one in re.findall(r'anchor="([\w-]+)"', file.read_text("utf-8"))}
    links = re.findall(r"\]\(http://localhost:8501/(\w+)#?([\w-]*)\)", README)
    assert {page for page, _ in links} <= pages
    assert {""} < {anchor for _, anchor in links} <= written | {""}


# The docstrings

PACKAGE = PROJECT / "stereolag"
PUBLIC = [name for name in sl.__all__ if name != "__version__"]
OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__")


WITH_EXAMPLES = sorted(module_of(path) for path in PACKAGE.rglob("*.py") if ">>> " in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_name_has_an_example(name: str) -> None:
    described, _, shown = (inspect.getdoc(getattr(sl, name)) or "").partition("\nExamples\n--------\n")
    assert described.strip()
    assert doctest.DocTestParser().get_examples(shown)


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_the_examples_run(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runner, report = doctest.DocTestRunner(optionflags=OPTIONS), io.StringIO()
    for example in doctest.DocTestFinder().find(importlib.import_module(module)):
        runner.run(example, out=report.write)
    assert runner.tries > 0
    assert runner.failures == 0, report.getvalue()


def test_help_names_everything_that_is_public() -> None:
    tour = sl.__doc__ or ""
    assert not [name for name in PUBLIC if not re.search(rf"`{name}`|sl\.{name}\(", tour)]
