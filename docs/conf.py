"""How Sphinx builds these pages: ``make docs``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# Loops stay plain functions then, whose signatures and docstrings autodoc can read.
os.environ["NUMBA_DISABLE_JIT"] = "1"

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent), str(DOCS / "extensions")]

from stereolag.version import VERSION  # noqa: E402

project = "stereolag"
author = "the stereolag authors"
copyright = author
release = version = VERSION

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "included",
    "mathml",
    "settings_fields",
]
exclude_patterns = ["_build"]
templates_path = ["_templates"]

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
default_role = "literal"
highlight_language = "none"
add_module_names = False

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autosummary_ignore_module_all = False
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "furo"
html_title = f"stereolag {VERSION}"
html_favicon = "../stereolag/ui/icon.svg"
html_math_renderer = "mathml"
html_copy_source = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#5a4a9c", "color-brand-content": "#5a4a9c"},
    "dark_css_variables": {"color-brand-primary": "#b9aef0", "color-brand-content": "#b9aef0"},
}
html_static_path = ["_static"]
html_css_files = ["tables.css"]
