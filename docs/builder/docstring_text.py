"""Docstrings in reStructuredText: numpy's sections, entries ``name : what it is``, indented code.

The house writes entries in two ways, a type with the description below, or the description alone on the line of the
name, and in the summaries of plain rows without a heading. Sphinx's own reader of numpy docstrings takes the second for
a type and the third for a broken list; numpydoc takes the description of 194 of 618 public entries for a type. Here
both become definition lists, and single words stay as they are written: no asterisk, bar or trailing underscore means
anything outside of code.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

#: Two names and a colon: ``lower, upper : [m], the bracket``.
ENTRY = re.compile(r"^(\*{0,2}[\w.]+(?:, ?\*{0,2}[\w.]+)*) : (.*)$")
#: Names alone, their description below.
BARE = re.compile(r"^\w+(?:, \w+)*$")
#: Sections of entries.
LISTED = ("Parameters", "Attributes", "Returns", "Yields", "Raises")
UNDERLINE = re.compile(r"^-{3,}$")
#: Markup that prose does not mean: outside of backticks only.
MARKUP = re.compile(r"(``.*?``|`[^`]+`)(?=(\w?))|([*|\\]|(?<=\w)_(?!\w))")


def to_rest(lines: list[str]) -> list[str]:
    """The lines of a docstring, without margin, as reStructuredText."""
    return [line for heading, body in sections(list(lines)) for line in _section(heading, body)]


def sections(lines: list[str]) -> Iterator[tuple[str, list[str]]]:
    """(heading, lines) of each section, the first of which has none."""
    heading, body = "", []
    for k, line in enumerate(lines):
        if UNDERLINE.match(line) and k and lines[k - 1].strip():
            continue
        if k + 1 < len(lines) and UNDERLINE.match(lines[k + 1]) and re.match(r"^[A-Z][A-Za-z ]+$", line):
            yield heading, body
            heading, body = line, []
            continue
        body.append(line)
    yield heading, body


def _section(heading: str, body: list[str]) -> list[str]:
    made = [f".. rubric:: {heading}", ""] if heading else []
    listed = heading in LISTED
    for block in _blocks(body):
        made += [*_block(block, listed), ""]
    return made


def _blocks(body: list[str]) -> Iterator[list[str]]:
    """Paragraphs; an indented one stays with the entry above it, and with the indented code before it."""
    block: list[str] = []
    for line in [*body, ""]:
        if line.strip():
            block.append(line)
        elif block:
            yield block
            block = []


def _block(block: list[str], listed: bool) -> list[str]:
    first = block[0]
    if first.startswith(("===", ">>>", "+--", ".. ")):  # a table, a session, a directive
        return block
    if first.startswith(" "):
        return ["::", "", *("    " + line for line in block)]
    if re.match(r"^(?:[-•*]|\d+\.) ", first):
        return [_plain(line) for line in block]
    if ENTRY.match(first) or (listed and len(block) > 1 and block[1].startswith(" ")):
        return _entries(block)
    return _paragraph(block)


def _paragraph(block: list[str]) -> list[str]:
    """Prose; entries may begin in the middle of a block, indented lines are the prose's own."""
    for k, line in enumerate(block):
        if k and ENTRY.match(line):
            return [*_paragraph(block[:k]), "", *_entries(block[k:])]
    return [_plain(line.strip()) for line in block]


def _entries(block: list[str]) -> list[str]:
    made: list[str] = []
    term, about = block[0], []
    for line in block[1:]:
        if line.startswith(" "):
            about.append(line.strip())
            continue
        made += _entry(term, about)
        term, about = line, []
    return made + _entry(term, about)


def _entry(line: str, about: list[str]) -> list[str]:
    """One entry, or several that stand on a line, three blanks between them; what is below is about the last."""
    *before, last = re.split(r" {3,}(?=[\w, ]+ : )", line)
    return [text for part in before for text in _definition(part, [])] + _definition(last, about)


def _definition(line: str, about: list[str]) -> list[str]:
    match = ENTRY.match(line)
    if match is None:
        term = f"``{line}``" if BARE.match(line) else _plain(line)
        return [term, *("    " + _plain(text) for text in about or ["\\ "]), ""]
    names, rest = match.groups()
    term = ", ".join(f"``{name.strip()}``" for name in names.split(","))
    if about and not rest.endswith((".", ",", ";", ":")) and about[0][:1] in _OPENS:
        return [f"{term} : {_plain(rest)}", *("    " + _plain(text) for text in about), ""]
    return [term, *("    " + _plain(text) for text in [rest, *about] if text), ""]


#: What a description on a line of its own begins with; lines that go on begin in the middle of a sentence.
_OPENS = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZ`([0123456789+−")


def _plain(text: str) -> str:
    """Text in which only code is marked."""
    return MARKUP.sub(_marked, text)


def _marked(match: re.Match) -> str:
    code, letter, sign = match.groups()
    return f"\\{sign}" if sign else code + "\\" * bool(letter)  # "`Compound`s": code ends where a word goes on
