"""The README: programs and commands run and agree with the app, figures are measured, pictures and links exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from commanded import Command
from PIL import Image

import stereolag as sl
from stereolag.core.settings import changed

PROJECT = Path(__file__).resolve().parents[2]
README = (PROJECT / "README.md").read_text(encoding="utf-8")
SCREENS = PROJECT / "docs" / "screens"
SCHEMES = ("light", "dark")

PICTURE = re.compile(
    r'<picture><source media="\(prefers-color-scheme: dark\)" srcset="([^"]+)">\n'
    r'<img alt="([^"]+)" src="([^"]+)" width="830"></picture>'
)


def programs() -> list[str]:
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(blocks) == 2
    return blocks


def commands(page: str) -> list[str]:
    """Return the commands shown on a page, verbatim."""
    text = (PROJECT / page).read_text(encoding="utf-8")
    (block,) = re.findall(r"```\n(stereolag (?!app).*?)```", text, re.DOTALL)
    return block.splitlines()


def section(title: str) -> str:
    return README.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def anchors(file: Path) -> set[str]:
    """Return the anchors of a Markdown file, as GitHub derives them from the headings."""
    titles = re.findall(r"^#+ (.+)$", file.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_it_is_read_in_one_go() -> None:
    assert README.count("\n") < 200


FRAMES = 4


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


def test_the_program_runs(capsys: pytest.CaptureFixture[str]) -> None:
    exec(programs()[0], {})
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
    exec(programs()[1], {"sl": sl})  # it continues the program before it
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


def test_every_figure_is_one_that_was_measured() -> None:
    results = "".join(
        (PROJECT / f"benchmarks/results/{name}.md").read_text("utf-8")
        for name in ("speed", "accuracy", "flow", "sequences")
    )
    measured = {float(number.replace(",", "")) for number in re.findall(r"\d[\d,]*(?:\.\d+)?", results)}
    rows = re.findall(r"^\| (?!task|---).*$", section("Figures"), re.MULTILINE)
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


def test_every_picture_is_there_light_and_dark_and_says_what_it_shows() -> None:
    shown = PICTURE.findall(README)
    assert len(shown) == README.count("<img ") == README.count("<picture>") > 5
    for dark, alternative, light in shown:
        assert dark == light.replace("-light.", "-dark.")
        assert re.fullmatch(r".{40,250}\.", alternative), alternative
        sizes = []
        for name in (light, dark):
            with Image.open(PROJECT / name) as picture:
                sizes.append(picture.size)
            assert (PROJECT / name).stat().st_size < 150_000, name
        assert sizes[0] == sizes[1]
    named = {Path(name).name for dark, _, light in shown for name in (dark, light)}
    assert named == {file.name for file in SCREENS.iterdir()}
    assert sum(file.stat().st_size for file in SCREENS.iterdir()) < 1_500_000


def test_every_link_leads_to_something() -> None:
    pages = {file.stem.partition("_")[2] for file in (PROJECT / "pages").glob("*.py")}
    links = re.findall(r"\]\(([^)\s]+)\)", README)
    assert len(links) > 20
    for target in links:
        page = re.fullmatch(r"http://localhost:8501/(\w+)(#[\w-]+)?", target)
        if page:
            assert page[1] in pages, target
        elif not target.startswith("https://"):
            name, _, anchor = target.partition("#")
            assert (PROJECT / name).is_file(), target
            assert not anchor or anchor in anchors(PROJECT / name), target


def test_the_anchors_of_the_app_are_those_of_its_headings() -> None:
    named = set(re.findall(r"http://localhost:8501/\w+#([\w-]+)", README))
    sources = [*(PROJECT / "pages").glob("*.py"), *(PROJECT / "stereolag/ui").rglob("*.py")]
    written = {one for file in sources for one in re.findall(r'anchor="([\w-]+)"', file.read_text("utf-8"))}
    assert named
    assert named <= written
