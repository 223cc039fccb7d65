"""Links with anchors lead to headings that exist: of pages, and in what examples and docstrings say of pages."""

from __future__ import annotations

import os
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\]\(([^)#\s]*)#([^)\s]+)\)")
#: A page and a heading of it, or a page alone, as examples and docstrings name them.
NAMED = re.compile(r"\b((?:docs|benchmarks|examples)/[\w./-]+\.md)(?:#([\w-]+))?")


def pages() -> list[Path]:
    return [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "benchmarks").glob("*.md")]


def without_code(text: str) -> str:
    return re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)


@cache
def anchors(page: Path) -> set[str]:
    """What a page's headings are called in links, as GitHub and MyST make it; a second one of a name gets a number."""
    found: set[str] = set()
    for heading in re.findall(r"^#{1,6} (.+)$", without_code(page.read_text(encoding="utf-8")), flags=re.MULTILINE):
        plain = re.sub(r"[`*]|\]\([^)]*\)|\[", "", heading).strip().lower()
        slug = re.sub(r"[^\w\- ]", "", plain).replace(" ", "-")
        number = 1
        while (name := slug if number == 1 else f"{slug}-{number - 1}") in found:
            number += 1
        found.add(name)
    return found


def wrong_anchors(page: Path, text: str) -> list[str]:
    """Links of a page's text whose page or heading does not exist."""
    wrong = []
    for target, anchor in LINK.findall(without_code(text)):
        place = Path(os.path.normpath(page.parent / target)) if target else page
        if "://" in target or place.suffix != ".md":
            continue
        if not place.is_file() or anchor not in anchors(place):
            wrong.append(f"{page.name}: {target}#{anchor}")
    return wrong


def test_anchors_between_pages_exist():
    texts = {page: page.read_text(encoding="utf-8") for page in pages()}
    assert sum(len(LINK.findall(text)) for text in texts.values()) >= 5, "the rule would pass on nothing"
    assert not (wrong := [line for page, text in texts.items() for line in wrong_anchors(page, text)]), wrong


def test_pages_that_code_names_exist():
    """``docs/report-schema.md explains it``, in examples, docstrings and the help of commands."""
    folders = ("collide", "adapters", "scenes", "examples", "benchmarks")
    named, wrong = 0, []
    for file in (file for folder in folders for file in (ROOT / folder).rglob("*.py")):
        for path, anchor in NAMED.findall(file.read_text(encoding="utf-8")):
            named += 1
            if not (ROOT / path).is_file() or (anchor and anchor not in anchors(ROOT / path)):
                wrong.append(f"{file.relative_to(ROOT)}: {path}{'#' * bool(anchor)}{anchor}")
    assert named >= 20, "the rule would pass on nothing"
    assert not wrong, wrong


def test_rule_sees_a_wrong_anchor(tmp_path):
    page = tmp_path / "page.md"
    text = "# A `b`: c\n\n## Twice\n\n## Twice\n\n```\n# code\n```\n"
    page.write_text(text, encoding="utf-8")
    assert anchors(page) == {"a-b-c", "twice", "twice-1"}
    links = text + "[x](#twice-1) [y](page.md#a-b-c) [z](#code) [w](other.md#a)"
    assert wrong_anchors(page, links) == ["page.md: #code", "page.md: other.md#a"]
