"""JSON as text, a piece at a time: a report of millions of pairs is never held as one text or tree of dicts."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator

from collide.reports.pair_classes import Pairs

#: Pairs written at a time.
_CHUNK = 2048


def pieces(items: Iterable[tuple[str, object]], *, ascii_only: bool = False) -> Iterator[str]:
    """A JSON object as consecutive pieces of text: keys indented, a line for each of `Pairs`.

    items : (key, value) in order; values are plain data or `Pairs`.   ascii_only : for a terminal of any encoding.
    """
    encode = json.JSONEncoder(allow_nan=False, ensure_ascii=ascii_only).encode
    between = "{\n"
    for key, value in items:
        yield f"{between}  {encode(key)}: "
        if isinstance(value, Pairs):
            yield from _lines(value, encode)
        else:
            yield _indented(value, ascii_only)
        between = ",\n"
    yield "\n}\n"


def _indented(value: object, ascii_only: bool) -> str:
    text = json.dumps(value, indent=2, allow_nan=False, ensure_ascii=ascii_only)
    return text.replace("\n", "\n  ")  # no text in JSON holds a line break of its own


def _lines(pairs: Pairs, encode) -> Iterator[str]:
    if not len(pairs):
        yield "[]"
        return
    lines: list[str] = []
    between = "[\n    "
    for data in pairs.dicts():
        lines.append(encode(data))
        if len(lines) == _CHUNK:
            yield between + ",\n    ".join(lines)
            between, lines = ",\n    ", []
    yield between + ",\n    ".join(lines) + "\n  ]" if lines else "\n  ]"
