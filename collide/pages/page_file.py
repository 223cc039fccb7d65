"""An HTML file: the template in ``viewer/``, filled; nothing is fetched, and no text of a scene is markup.

Data stand in ``<script type="application/json">`` blocks, in ASCII and without ``<``, ``>`` and ``&``: no name can end
its block. A policy in the page names the only script and the only style by their SHA-256, so that a browser runs and
shows nothing else, and sends no request to a server.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from collide.base.whole_file import write_whole
from collide.errors import InvalidArgument, cut
from collide.reports.json_text import pieces

#: The page, its style and its script.
VIEWER = Path(__file__).resolve().parent / "viewer"
#: What would end the element that a file of the viewer stands in.
_ENDS = {"page.css": ("</style", "<!--"), "bundle.js": ("</script", "<!--")}
#: In JSON these stand in texts alone, where they may be written so.
_ESCAPES = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026"})
#: Longest title, in characters.
_LONGEST_TITLE = 200
_ENCODE = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode


class ReportBlock(NamedTuple):
    """A report in a page: the block's id, and the object as (key, value) pairs in order, written as ``--json`` does."""

    id: str
    items: Iterable[tuple[str, object]]


class DataBlock(NamedTuple):
    """Other data in a page: the block's id, and an object or an array; written without blanks, entries one a line."""

    id: str
    data: dict | list


Blocks = Iterable[ReportBlock | DataBlock]


def page_pieces(title: str, blocks: Blocks, *, live: bool = False, viewer: Path | None = None) -> Iterator[str]:
    """The page as consecutive pieces of text.

    Parameters
    ----------
    title : any text.
    blocks : data of the page; values are plain data or `collide.reports.pair_classes.Pairs`.
    live : the page may send requests to its own server, and to no other.
    viewer : folder with ``page.html``, ``page.css`` and ``bundle.js``; by default the package's own.

    Raises
    ------
    InvalidArgument : the viewer's files are missing, or not fit for a page.
    """
    viewer = VIEWER if viewer is None else viewer
    template, style, script = (_read(viewer, name) for name in ("page.html", "page.css", "bundle.js"))
    fixed = {
        "<!--TITLE-->": f"<title>{_text(cut(title, _LONGEST_TITLE))}</title>\n",
        "<!--POLICY-->": f'<meta http-equiv="Content-Security-Policy" content="{_policy(script, style, live)}">\n',
        "<!--STYLE-->": f"<style>{style}</style>\n",
        "<!--SCRIPT-->": f"<script>{script}</script>\n",
    }
    missing = [name for name in (*fixed, "<!--DATA-->") if template.count(name) != 1]
    if missing:
        raise InvalidArgument(f"{viewer / 'page.html'}: needs {', '.join(missing)} once, each on a line of its own")
    return _filled(template, fixed, blocks)


def _filled(template: str, fixed: dict[str, str], blocks: Blocks) -> Iterator[str]:
    for line in template.splitlines(keepends=True):
        name = line.strip()
        if name == "<!--DATA-->":
            for block in blocks:
                yield from _block(block)
        else:
            yield fixed.get(name, line)


def _read(viewer: Path, name: str) -> str:
    try:
        text = (viewer / name).read_text(encoding="utf-8")
    except OSError as error:
        raise InvalidArgument(
            f"the viewer of pages is not whole: {viewer / name}: {error.strerror}; install collide-robotics again"
        ) from None
    for end in _ENDS.get(name, ()):
        if end in text.lower():
            raise InvalidArgument(f"{viewer / name} has {end} in it, which would end its element: build it anew")
    return text


def _policy(script: str, style: str, live: bool) -> str:
    """What the browser may do with the page. The hashes are of the two texts exactly as they stand in it."""
    rules = [
        "default-src 'none'", f"script-src {_hash_of(script)}", f"style-src {_hash_of(style)}", "img-src data: blob:",
        "base-uri 'none'", "form-action 'none'", *(["connect-src 'self'"] if live else []),
    ]
    return "; ".join(rules)


def _hash_of(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _text(text: str) -> str:
    """Text as ASCII HTML; half of a surrogate pair, not allowed in files, becomes a character reference."""
    return html.escape(text).encode("ascii", "xmlcharrefreplace").decode()


def _block(block: ReportBlock | DataBlock) -> Iterator[str]:
    yield f'<script type="application/json" id="{block.id}">\n'
    inner = pieces(block.items, ascii_only=True) if isinstance(block, ReportBlock) else _lines(block.data)
    for piece in inner:
        yield piece.translate(_ESCAPES)
    yield "</script>\n"


def _lines(data: dict | list) -> Iterator[str]:
    """JSON in ASCII: a line for each entry of an array and each key of an object."""
    if isinstance(data, list):
        yield from _between("[", (_ENCODE(entry) for entry in data), "]")
        return
    yield "{"
    for k, (key, value) in enumerate(data.items()):
        yield f"{',' if k else ''}\n{_ENCODE(key)}:"
        yield from _lines(value) if isinstance(value, list) else [_ENCODE(value)]
    yield "\n}\n"


def _between(start: str, entries: Iterable[str], end: str) -> Iterator[str]:
    yield start
    for k, entry in enumerate(entries):
        yield f"{',' if k else ''}\n{entry}"
    yield f"\n{end}"


# --- to a file ----------------------------------------------------------------------------------


def write_page(text: Iterable[str], place: str) -> None:
    """Pieces of text to a file, all of them or none; ``-`` is standard output, devices are written to as they are.

    Raises OSError with the name of the file.
    """
    if place == "-":
        _write_to_stdout(text)
        return
    write_whole(place, text)


def _write_to_stdout(text: Iterable[str]) -> None:
    """UTF-8, as the page says, whatever the terminal's encoding is."""
    sys.stdout.flush()
    binary = getattr(sys.stdout, "buffer", None)
    for piece in text:
        if binary is None:
            sys.stdout.write(piece)
        else:
            binary.write(piece.encode())
    sys.stdout.flush()
