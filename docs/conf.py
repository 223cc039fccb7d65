"""How Sphinx makes the site: ``sphinx-build -W -c docs . build/site`` from the repository's root.

The root is the source folder, so that links from README to docs/ and from docs/ to files of the code hold in the site
as they do in the repository. What has no page of its own there gets one from `builder/`: the public names, room by
room, and the folders that pages link to. Nothing is fetched, while building or when the site is read.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs" / "builder"))

from docstring_text import to_rest
from site_pages import REPORT, Links, write_pages

project = "collide"
author = "the collide project"
root_doc = "README"
include_patterns = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "benchmarks/README.md", "docs/**"]
exclude_patterns = ["docs/builder/**", "build/**", ".venv/**", "**/__pycache__/**"]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]

myst_heading_anchors = 4
myst_enable_extensions = ["deflist"]
#: "`name`" in docstrings is code, as it is in Markdown.
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"
#: Pages quote file formats and terminals that no lexer knows whole; they are shown as they stand.
suppress_warnings = ["misc.highlighting_failure"]

html_theme = "furo"
html_title = "collide"
html_copy_source = False
html_show_copyright = False
html_extra_path = ["_site/extra"]
(ROOT / REPORT).parent.mkdir(parents=True, exist_ok=True)  # Sphinx asks for it before pages are made
html_additional_pages = {"index": "to_readme.html"}
templates_path = ["builder/templates"]


def setup(app):
    """Pages are written before sources are read; links and docstrings are put into Sphinx's words as they are read."""
    links = Links(ROOT)
    app.connect("builder-inited", lambda app: write_pages(ROOT))
    app.connect("source-read", links.rewrite)
    # before the standard handlers, which cut margins
    app.connect("autodoc-process-docstring", _docstring, priority=400)


def _docstring(app, what, name, value, options, lines) -> None:
    lines[:] = to_rest(lines)
