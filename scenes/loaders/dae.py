"""COLLADA: checked here, then read by pycollada, which takes NaN for 0, negative ids and bad units without a word."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NoReturn

import numpy as np

from collide.errors import SceneError, brief, cut
from collide.scenes.loaders.files import DEEPEST, MAX_NODES
from collide.scenes.loaders.polygons import refuse

#: How many corners the ids of a primitive make, where no count of its own says it.
_PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def check(content: bytes, path: Path) -> list[str]:
    """Notes about what is not read; SceneError for numbers, counts, ids and units that are none."""
    try:
        root = ET.fromstring(content)
    except (ET.ParseError, ValueError, LookupError) as error:
        raise SceneError(f"is not well-formed XML: {error}", path=path) from None
    for element in root.iter():
        element.tag = element.tag.rsplit("}", 1)[-1] if isinstance(element.tag, str) else ""
    if root.tag != "COLLADA":
        refuse(path, f"is no COLLADA: its outermost element is <{cut(root.tag)}>")
    _check_unit(root, path)
    by_id = {element.get("id"): element for element in root.iter() if element.get("id")}
    for mesh in root.iter("mesh"):
        for primitive in mesh:
            if primitive.tag in _PRIMITIVES:
                _check_primitive(primitive, by_id, path)
    _check_nodes(root, by_id, path)
    notes = []
    if next(root.iter("instance_controller"), None) is not None:
        notes.append("meshes that bones move (<instance_controller>) were not read")
    axis = (root.findtext("asset/up_axis") or "Z_UP").strip()
    if axis != "Z_UP":
        notes.append(f"<up_axis> {cut(axis)} turned nothing: coordinates are as in the file, as RViz has them")
    return notes


def _at(path: Path, element: ET.Element, what: str, inside: str = "") -> NoReturn:
    name = "".join(f' {key}="{cut(element.get(key) or "")}"' for key in ("id", "name", "material") if element.get(key))[
        :100
    ]
    raise SceneError(what, path=path, element=f"<{element.tag}{name}>{inside}")


def _check_unit(root: ET.Element, path: Path) -> None:
    unit = root.find("asset/unit")
    if unit is None:
        return
    try:
        metre = float(unit.get("meter", "1"))
    except ValueError:
        metre = math.nan
    if not 0.0 < metre < math.inf:
        unit_text = brief(unit.get("meter"))
        _at(
            path,
            unit,
            f"meter must be a finite number above 0, got {unit_text}: it says how many metres the unit has; 1 is a "
            "metre",
        )


# --- meshes ---------------------------------------------------------------------------------------


def _numbers(element: ET.Element | None, kind: type, path: Path, inside: str = "") -> np.ndarray:
    words = (element.text or "").split() if element is not None else []
    try:
        if "_" in "".join(words):
            raise ValueError
        return np.array([kind(word) for word in words], dtype=np.float64 if kind is float else np.int64)
    except (ValueError, OverflowError):
        what = "a number" if kind is float else "a whole number"
        bad = next(word for word in words if not _reads(word, kind))
    assert element is not None
    _at(path, element, f"must hold {what} at every place, got {brief(bad)}", inside)


def _reads(word: str, kind: type) -> bool:
    try:
        return "_" not in word and abs(kind(word)) <= (math.inf if kind is float else 2**62)
    except ValueError:
        return False


def _count(element: ET.Element, key: str, path: Path) -> int | None:
    text = element.get(key)
    if text is None:
        return None
    if not (text.strip().isdigit() and text.isascii()):
        _at(path, element, f"{key} must be a whole number, 0 or more, got {brief(text)}")
    return int(text[:18])


def _check_primitive(primitive: ET.Element, by_id: dict, path: Path) -> None:
    inputs = primitive.findall("input")
    if not inputs:
        return
    offsets = [_count(index, "offset", path) or 0 for index in inputs]
    stride = max(offsets) + 1
    vertex = next((k for k, index in enumerate(inputs) if index.get("semantic") == "VERTEX"), None)
    ids = [_numbers(p, int, path) for p in primitive.iter("p")]
    if vertex is not None:
        positions = _positions(inputs[vertex], by_id, path)
        for index in ids:
            corners = index[offsets[vertex] :: stride]
            outside = (corners < 0) | (corners >= positions)
            if outside.any():
                k = int(np.argmax(outside))
                _at(
                    path,
                    primitive,
                    f"corner {k} is vertex {int(corners[k])}, but there are 0 ... {positions - 1}",
                    " <p>",
                )
    _check_counts(primitive, [len(index) for index in ids], stride, path)


def _check_counts(primitive: ET.Element, lengths: list[int], stride: int, path: Path) -> None:
    count = _count(primitive, "count", path)
    declared: int | None = None
    if primitive.tag == "triangles" and count is not None:
        declared = 3 * count * stride
    elif primitive.tag == "polylist":
        corners = _numbers(primitive.find("vcount"), int, path)
        if (corners < 0).any() or (count is not None and len(corners) != count):
            _at(
                path,
                primitive,
                f"says count {count}, but <vcount> holds {len(corners)} numbers, the least "
                f"{corners.min() if len(corners) else 0}",
            )
        declared = int(corners.sum()) * stride
    elif count is not None and len(lengths) != count:
        _at(path, primitive, f"says count {count}, but has {len(lengths)} of <p>: it was cut short or is damaged")
    if declared is not None and sum(lengths) != declared:
        _at(
            path,
            primitive,
            f"says {declared} numbers, {stride} a corner, but <p> holds {sum(lengths)}: it was cut short or is damaged",
        )
    if any(length % stride for length in lengths):
        _at(
            path,
            primitive,
            f"has {stride} numbers a corner, but a <p> of {next(n for n in lengths if n % stride)} numbers",
        )


def _positions(vertex: ET.Element, by_id: dict, path: Path) -> int:
    """How many positions a VERTEX input names; they must be finite, and as many as their counts say."""
    vertices = _named(vertex, "source", by_id, path)
    place = next(
        (
            semantic_input
            for semantic_input in vertices.findall("input")
            if semantic_input.get("semantic") == "POSITION"
        ),
        None,
    )
    if place is None:
        _at(path, vertices, 'has no <input semantic="POSITION">')
    source = _named(place, "source", by_id, path)
    array = source.find("float_array")
    if array is None:
        _at(path, source, "has no <float_array>")
    values = _numbers(array, float, path)
    if not np.isfinite(values).all():
        k = int(np.argmax(~np.isfinite(values)))
        _at(path, array, f"number {k} is {values[k]}: coordinates must be finite")
    count, accessor = _count(array, "count", path), source.find("technique_common/accessor")
    if count is not None and count != len(values):
        _at(path, array, f"says count {count}, but holds {len(values)} numbers: it was cut short or is damaged")
    rows, width = len(values) // 3, 3
    if accessor is not None:
        width = _count(accessor, "stride", path) or 1
        declared_count = _count(accessor, "count", path)
        rows = len(values) // width if declared_count is None else declared_count
        if width < 3 or rows * width + (_count(accessor, "offset", path) or 0) > len(values):
            _at(path, accessor, f"says {rows} rows of {width}, but there are {len(values)} numbers")
    return rows


def _named(element: ET.Element, key: str, by_id: dict, path: Path) -> ET.Element:
    referenced = by_id.get((element.get(key) or "").removeprefix("#"))
    if referenced is None:
        _at(path, element, f"{key} names {brief(element.get(key))}, which is not in the file")
    return referenced


# --- nodes ----------------------------------------------------------------------------------------


def _check_nodes(root: ET.Element, by_id: dict, path: Path) -> None:
    """Limit the depth of nodes, and their number with repeats: pycollada and trimesh recurse."""
    sizes: dict[ET.Element, int] = {}  # of nodes that were looked at: how many they are with what stands in them

    def inner(node: ET.Element) -> list[ET.Element]:
        repeated = [
            by_id.get((instance.get("url") or "").removeprefix("#")) for instance in node.findall("instance_node")
        ]
        return [
            *node.findall("node"),
            *(instance for instance in repeated if instance is not None and instance.tag == "node"),
        ]

    for start in root.iter("node"):
        waiting: list[ET.Element] = [start]
        opened: list[ET.Element] = []
        while waiting:
            node = waiting[-1]
            below = inner(node)
            if node in sizes:
                waiting.pop()
            elif opened and opened[-1] is node:
                sizes[node] = 1 + sum(sizes[child] for child in below)
                if sizes[node] > MAX_NODES:
                    _at(path, node, f"with what it repeats it is {sizes[node]} nodes; read are at most {MAX_NODES:,}")
                waiting.pop()
                opened.pop()
            else:
                opened.append(node)
                if len(opened) > DEEPEST:
                    _at(path, node, f"nodes stand more than {DEEPEST} deep in one another: nest less")
                if any(child in opened for child in below):
                    _at(path, node, "stands below itself: nodes are trees")
                waiting += below
