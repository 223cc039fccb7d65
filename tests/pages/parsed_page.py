"""A page as a parser of HTML that knows nothing of ours reads it, and a small viewer to fill."""

from __future__ import annotations

import json
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

TEMPLATE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<!--TITLE-->
<!--POLICY-->
<!--STYLE-->
</head>
<body>
<main id="here"></main>
<!--DATA-->
<!--SCRIPT-->
</body>
</html>
"""


def small_viewer(folder: Path) -> Path:
    """A folder as the writer of pages wants it."""
    folder.mkdir(exist_ok=True)
    (folder / "page.html").write_text(TEMPLATE, encoding="utf-8")
    (folder / "page.css").write_text("body { margin: 0; content: 'é'; }\n", encoding="utf-8")
    (folder / "bundle.js").write_text('"use strict";\nconst a = 1 < 2 && "ü";\n', encoding="utf-8")
    return folder


class Page(HTMLParser):
    """elements : how often each tag starts.   attributes : of every element, in order.   texts : by (tag, id)."""

    def __init__(self, text: str):
        super().__init__(convert_charrefs=True)
        self.elements: Counter = Counter()
        self.attributes: list[tuple[str, dict]] = []
        self.texts: dict[tuple[str, str], str] = {}
        self.comments: list[str] = []
        self._open: list[tuple[str, str]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements[tag] += 1
        self.attributes.append((tag, dict(attrs)))
        if tag != "meta":
            self._open.append((tag, dict(attrs).get("id", "")))

    def handle_endtag(self, tag):
        assert self._open and self._open[-1][0] == tag, f"</{tag}> ends {self._open[-1:]}"
        self._open.pop()

    def handle_data(self, data):
        if self._open:
            self.texts[self._open[-1]] = self.texts.get(self._open[-1], "") + data

    def handle_comment(self, data):
        self.comments.append(data)

    def data(self, name: str):
        """The JSON of a block, with no number that JSON does not know."""
        return json.loads(self.texts["script", name], parse_constant=_refuse)

    @property
    def policy(self) -> str:
        return next(a["content"] for tag, a in self.attributes if a.get("http-equiv") == "Content-Security-Policy")


def _refuse(word: str):
    raise ValueError(f"{word} is not JSON")
