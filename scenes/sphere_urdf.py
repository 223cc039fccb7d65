"""A URDF with spheres in the place of its links' collision elements; the rest of the file stays, byte for byte."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.parsers import expat

from collide.errors import SceneError, cut

#: A tag up to its end, ``>`` in quoted values left alone.
_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")


class LinkSpheres(NamedTuple):
    """Spheres of a link.

    centers, radii : (n, 3) and (n,) in the frame of the link [m].   comment : a line for readers of the file.
    """

    centers: Any
    radii: Any
    comment: str


class _Element(NamedTuple):
    """A collision element: its link, and its bytes from ``start`` to ``end``."""

    link: str
    start: int
    end: int


def with_spheres(file: Path, links: Mapping[str, LinkSpheres]) -> bytes:
    """The text of a URDF with spheres for the collision elements of some links.

    file : the URDF.   links : name → spheres; other links keep what they have.

    Raises SceneError where the file is no URDF, is not written in UTF-8, or has no collision element in such a link.
    """
    data = file.read_bytes()
    elements = _collisions(file, data)
    missing = [name for name in links if all(element.link != name for element in elements)]
    if missing:
        raise SceneError("has no collision element to put spheres in place of", path=file,
                         element=f'link "{cut(missing[0])}"')
    pieces: list[bytes] = []
    written: set[str] = set()
    at = 0
    for element in elements:
        if element.link not in links:
            continue
        before = data[at : element.start]
        indent = before[len(before.rstrip(b" \t")) :]
        if element.link in written:
            pieces.append(before[: len(before.rstrip())])
        else:
            pieces += [before, _spheres(links[element.link], indent)]
        written.add(element.link)
        at = element.end
    return b"".join([*pieces, data[at:]])


def _spheres(link: LinkSpheres, indent: bytes) -> bytes:
    """The elements; numbers are written so that they are read again as the same doubles."""
    lines = [f"<!-- {link.comment.replace('--', '- -')} -->"]
    for center, radius in zip(link.centers.tolist(), link.radii.tolist()):
        xyz = " ".join(repr(x + 0.0) for x in center)
        geometry = f'<geometry><sphere radius="{radius!r}"/></geometry>'
        lines.append(f'<collision><origin xyz="{xyz}" rpy="0 0 0"/>{geometry}</collision>')
    return (b"\n" + indent).join(line.encode() for line in lines)


def _collisions(file: Path, data: bytes) -> list[_Element]:
    """The collision elements of all links, in the order of the file."""
    path: list[str] = []
    elements: list[_Element] = []
    parser = expat.ParserCreate()
    link, start = "", 0

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal link, start
        path.append(tag)
        if path == ["robot", "link"]:
            link = attributes.get("name", "")
        elif path == ["robot", "link", "collision"]:
            start = parser.CurrentByteIndex

    def end(_tag: str) -> None:
        if path == ["robot", "link", "collision"]:
            first = _tag_end(data, start)
            # Of an element of a single tag the parser gives the end of the tag, of others the begin of their last tag.
            last = first if data[first - 2 : first] == b"/>" else _tag_end(data, parser.CurrentByteIndex)
            elements.append(_Element(link, start, last))
        path.pop()

    def declared(_version: str, encoding: str | None, _standalone: int) -> None:
        if encoding is not None and encoding.lower() not in ("utf-8", "us-ascii", "ascii"):
            raise SceneError(f"is written in {encoding}: spheres are written into files in UTF-8 alone", path=file)

    parser.StartElementHandler, parser.EndElementHandler, parser.XmlDeclHandler = begin, end, declared
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise SceneError(f"is no XML: {error}", path=file) from None
    return elements


def _tag_end(data: bytes, start: int) -> int:
    match = _TAG.match(data, start)
    assert match is not None  # the parser has read it
    return match.end()
