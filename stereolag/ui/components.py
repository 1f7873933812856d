"""Components of the pages that run in the browser, each from a folder of ``web/``, and what is delivered to them.

The scripts are plain ES modules, so that they can be checked and tested as they are. Streamlit takes the script of a
component as one string and imports that from a ``blob:`` address, where relative imports lead nowhere; it serves the
files of an ``asset_dir`` for installed packages alone, and the app is also started from a checkout. Files served by
routes of our own would be a request for each module, to an address that depends on the path behind a proxy. So
:func:`joined` puts a module and the modules it imports into one string, each in a scope of its own: no further request,
no address, and nothing that a component does not use.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import streamlit as st

from stereolag.streamlit_inside import ComponentRenderer

WEB = Path(__file__).parent / "web"

IMPORT = re.compile(r'^import \{([^}]*)\} from "(\.[^"]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?:async )?(?:function|class|const) (\w+)", re.MULTILINE)
UNKNOWN = re.compile(r"^(?:import\b(?!\()|export (?!default\b)).*", re.MULTILINE)
STYLES = re.compile(r'^@import "(\.[^"]+)";\n', re.MULTILINE)


def component(name: str) -> ComponentRenderer:
    """Return the component whose module is ``web/<name>/<name>.js``, with its markup and styles beside it, if any."""
    files = {suffix: WEB / name / f"{name}.{suffix}" for suffix in ("html", "css", "js")}
    return st.components.v2.component(
        f"stereolag.{name}",
        html=files["html"].read_text(encoding="utf-8") if files["html"].exists() else None,
        css=styles(files["css"]) if files["css"].exists() else None,
        js=joined(files["js"]),
    )


def styles(path: Path) -> str:
    """Return a style sheet, with those it imports in place of the imports."""
    return STYLES.sub(lambda found: styles(path.parent / found[1]), path.read_text(encoding="utf-8"))


@cache
def joined(path: Path) -> str:
    """Return a module and all modules it imports as one module, each after those it needs.

    Imports and exports by name are supported, a function, class or constant each; only the module itself may have a
    default export.

    Raises
    ------
    ValueError
        If a module imports or exports in another way, or imports itself.
    """
    names: dict[Path, str] = {}
    scopes: list[str] = []

    def add(module: Path, importing: tuple[Path, ...]) -> str:
        if module in importing:
            raise ValueError(f"{module.name} imports itself, by way of {importing[-1].name}.")
        if module not in names:
            body, exported = translated(module, importing)
            scopes.append(f"const $m{len(names)} = (() => {{\n{body}return {{ {', '.join(exported)} }};\n}})();\n")
            names[module] = f"$m{len(names)}"
        return names[module]

    def translated(module: Path, importing: tuple[Path, ...]) -> tuple[str, list[str]]:
        text = module.read_text(encoding="utf-8")

        def bound(found: re.Match[str]) -> str:
            scope = add((module.parent / found[2]).resolve(), (*importing, module))
            return f"const {{{found[1].replace(' as ', ': ')}}} = {scope};\n"

        text = IMPORT.sub(bound, text)
        exported = EXPORT.findall(text)
        text = EXPORT.sub(lambda found: found[0].removeprefix("export "), text)
        unknown = UNKNOWN.search(text) or (re.search("^export default.*", text, re.MULTILINE) if importing else None)
        if unknown:
            raise ValueError(f"{module.name}: {unknown[0]!r} cannot be joined with other modules.")
        return text, exported

    body, _ = translated(path.resolve(), ())
    return "".join(scopes) + body


_delivery = component("delivery")


def deliver(item: bytes, *, key: str) -> None:
    """Send an item of :mod:`stereolag.ui.packing` to the components of the page that need it.

    Its header has a `kind`, and a `name` unless its digest is its name. Each delivery is a component of its own:
    Streamlit sends it again only if it has changed.

    Parameters
    ----------
    item
        The packed item.
    key
        Key of the delivery on the page.
    """
    _delivery(key=key, data=item)
