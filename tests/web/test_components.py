"""Modules of a component joined into the one string that Streamlit takes."""

import subprocess
from pathlib import Path

import pytest

from stereolag.ui.components import WEB, expanded, joined, script
from tests.web.node import node_path


def written(folder: Path, **modules: str) -> Path:
    """Write modules, and return the path of `main`."""
    for name, text in modules.items():
        (folder / f"{name}.js").write_text(text)
    return folder / "main.js"


def test_each_module_has_its_names_to_itself_and_is_made_once(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        base='const size = 3;\nconsole.log("made");\nexport const three = () => size;\nexport class Base {}\n',
        middle='import { three, Base } from "./base.js";\nconst size = 4;\n'
        "export async function seven() {\n  return size + three();\n}\nexport class Derived extends Base {}\n",
        main='import {\n  seven,\n  Derived as Panel,\n} from "./middle.js";\nimport { three } from "./base.js";\n'
        "export default () => 1;\nconsole.log(await seven(), three(), new Panel() instanceof Object);\n",
    )
    told = subprocess.run(
        [node_path(), "--input-type=module"], input=joined(path), capture_output=True, encoding="utf-8", check=False
    )
    assert told.stdout.split() == ["made", "7", "3", "true"], told.stderr


@pytest.mark.parametrize(
    ("modules", "message"),
    [
        ({"main": 'import * as all from "./other.js";\n', "other": ""}, r"main\.js: 'import \* as all"),
        ({"main": 'import { a } from "./other.js";\n', "other": "export let a = 1;\n"}, r"other\.js: 'export let a"),
        ({"main": 'import { a } from "./other.js";\n', "other": "export default 1;\n"}, r"other\.js: 'export default"),
        (
            {
                "main": 'import { a } from "./other.js";\n',
                "other": 'import { b } from "./main.js";\nexport const a = 1;\n',
            },
            r"main\.js imports itself, by way of other\.js",
        ),
    ],
)
def test_what_cannot_be_joined_is_refused(tmp_path: Path, modules: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        joined(written(tmp_path, **modules))


@pytest.mark.parametrize(("ending", "shared"), [("css", "legend.css"), ("html", "legends.html")])
def test_style_sheets_and_markup_have_those_they_import(ending: str, shared: str) -> None:
    legends = (WEB / "shared" / shared).read_text(encoding="utf-8")
    assert legends in expanded(WEB / "player" / f"player.{ending}")
    assert all("@import" not in expanded(path) for path in WEB.glob(f"*/*.{ending}"))


@pytest.mark.parametrize(
    "markup",
    sorted(path for path in WEB.glob("*/*.html") if path.stem == path.parent.name),
    ids=lambda markup: markup.stem,
)
def test_the_expressions_of_a_markup_are_code(tmp_path: Path, markup: Path) -> None:
    module = tmp_path / "module.mjs"
    module.write_text(script(markup.parent), encoding="utf-8")
    told = subprocess.run([node_path(), "--check", module], capture_output=True, encoding="utf-8", check=False)
    assert told.returncode == 0, told.stderr
