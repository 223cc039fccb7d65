"""XML as robots have it: read with undeclared prefixes tolerated and noted."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

from collide.base.given_files import read_bytes
from collide.errors import SceneError, listing
from collide.scenes.loaders.xacro_file import expanded


def parse_xml(path: Path, notes: list[str]) -> ET.Element:
    """The root of an XML file, its own default namespace taken off.

    Prefixes nobody declared are common in files made by hand from xacro; they are tolerated, since
    no element of URDF, SRDF or MJCF has a prefix, and noted. What is not XML at all is refused. Of a .xacro file the
    XML that it stands for is parsed.
    """
    content = expanded(path) if path.suffix.lower() == ".xacro" else read_bytes(path)
    blob = content.lstrip()  # blanks before <?xml ...?> are common, and harmless
    try:
        root = ET.fromstring(blob)
    except ET.ParseError as error:
        if "unbound prefix" not in str(error):
            raise SceneError(f"is not well-formed XML: {error}", path=path) from None
        root = _with_prefixes_declared(blob, path, notes)
    except (ValueError, LookupError) as error:
        raise SceneError(f"cannot be decoded as XML: {error}", path=path) from None
    if root.tag.startswith("{"):
        namespace = root.tag[: root.tag.index("}") + 1]
        for element in root.iter():
            if isinstance(element.tag, str) and element.tag.startswith(namespace):
                element.tag = element.tag[len(namespace) :]
    foreign = sorted({element.tag.rsplit("}", 1)[-1] for element in root.iter() if str(element.tag).startswith("{")})
    if foreign:
        notes.append(f"elements of another namespace were not read: {listing(foreign)}")
    return root


def _with_prefixes_declared(blob: bytes, path: Path, notes: list[str]) -> ET.Element:
    text = blob.decode("utf-8", errors="replace")
    used = set(re.findall(r"</?([A-Za-z_][\w.-]*):[A-Za-z_]", text))
    used |= set(re.findall(r"\s([A-Za-z_][\w.-]*):[A-Za-z_][\w.-]*\s*=", text))
    declared = set(re.findall(r"xmlns:([A-Za-z_][\w.-]*)\s*=", text))
    unbound = sorted(used - declared - {"xml", "xmlns"})
    start = re.search(r"<(?![?!])[^\s/>]+", text)
    if start is None or not unbound:
        raise SceneError("is not well-formed XML: a prefix is not declared", path=path)
    names = "".join(f' xmlns:{prefix}="undeclared:{prefix}"' for prefix in unbound)
    try:
        root = ET.fromstring(re.sub(r"^\s*<\?xml[^>]*\?>", "", text[: start.end()]) + names + text[start.end() :])
    except ET.ParseError as error:
        raise SceneError(
            f"is not well-formed XML, even with the prefix {listing(unbound)} declared: {error}", path=path
        ) from None
    notes.append(f"XML prefix not declared: {listing(unbound)}; what carries it was not read")
    return root
