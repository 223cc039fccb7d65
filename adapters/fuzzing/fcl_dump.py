"""What FCL prints when it aborts, read as pairs: "Error with configuration", two shapes, two poses, the solver.

FCL has written shapes in two ways: as streams (``Box0.3 0.3 0.3``, ``Cylinder(r: 0.05, lz: 0.06)``) and, since 2023,
as calls (``Box<double>(0.3, 0.3, 0.3);``), poses with and without commas. Both are read, out of any text around them:
logs, issues, Python tracebacks. Numbers are taken as they are printed, twenty digits, which give back the doubles.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from collide.adapters.fuzzing.fuzz_case import Case, pair_case
from collide.base.given_files import read_bytes
from collide.errors import InvalidPose, InvalidShape, SceneError
from collide.shapes import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, Halfspace, Shape, Sphere

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_DUMP = re.compile(
    r"Shape 1:(?P<a>.*?)X_FS1(?P<X_a>.*?)Shape 2:(?P<b>.*?)X_FS2(?P<X_b>.*?)(?=Solver|Shape 1:|Original error|\Z)",
    re.DOTALL,
)
_MESSAGE = re.compile(r"Original error message:(?P<text>.*?)(?=Shape 1:)", re.DOTALL)
#: Name of a shape in FCL → how many numbers it takes, and what is made of them.
_SHAPES: dict[str, tuple[int, Callable[..., Shape]]] = {
    "Box": (3, lambda x, y, z: Box((x, y, z))),
    "Sphere": (1, Sphere),
    "Capsule": (2, Capsule),
    "Cylinder": (2, Cylinder),
    "Cone": (2, Cone),
    "Ellipsoid": (3, lambda x, y, z: Ellipsoid((x, y, z))),
    "Halfspace": (4, lambda x, y, z, d: Halfspace((x, y, z), d)),
}


class FclDump(NamedTuple):
    """One dump: the pair, and the message that FCL gave, without folders."""

    case: Case
    message: str


def read_fcl_dumps(path: str | Path) -> list[FclDump]:
    """Every dump in a file.

    Parameters
    ----------
    path : str or Path
        A text file: a log, an issue, what a terminal showed.

    Returns
    -------
    list of FclDump
        In their order, at least one.

    Raises
    ------
    SceneError
        Where the file holds no dump, or one whose shapes it does not give in full.
        Also where it cannot be read, is no regular file, or is larger than a text that is read.
    """
    return parse_fcl_dumps(read_bytes(Path(path)).decode("utf-8", errors="replace"), str(path))


def parse_fcl_dumps(text: str, place: str = "the text") -> list[FclDump]:
    """Every dump in a text; ``place`` stands in messages. Raises SceneError as `read_fcl_dumps`."""
    text = _unquoted(text)
    messages = [" ".join(match["text"].split()) for match in _MESSAGE.finditer(text)]
    dumps = []
    for k, match in enumerate(_DUMP.finditer(text)):
        where = f"{place}: dump {k + 1}"
        A, B = (_shape(match[name], f"{where}: Shape {i}") for i, name in ((1, "a"), (2, "b")))
        X_WA, X_WB = (_pose(match[name], f"{where}: X_FS{i}") for i, name in ((1, "X_a"), (2, "X_b")))
        try:
            case = pair_case(A, B, X_WA, X_WB)
        except InvalidPose as error:
            raise SceneError(f"{where}: {error}") from None
        message = messages[k] if k < len(messages) else ""
        dumps.append(FclDump(case, re.sub(r"\S*/(?=[\w.+-]+)", "", message)))
    if not dumps:
        raise SceneError(
            f"{place}: no dump of FCL's in it: one begins with 'Error with configuration' and names Shape 1, X_FS1, "
            "Shape 2 and X_FS2"
        )
    return dumps


def _unquoted(text: str) -> str:
    """Without the marks that issues and logs put before each line, and with line ends that were written out."""
    text = text.replace("\\n", "\n")
    return "\n".join(re.sub(r"^\s*(?:[>|]\s*)+", "", line) for line in text.splitlines())


def _numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(_NUMBER, text)]


def _shape(text: str, place: str) -> Shape:
    text = text.strip()
    name = re.match(r"[A-Za-z]+", text)
    kind = name.group() if name else ""
    # without the name, what stands in <> and the labels "r:", "lz:"
    rest = re.sub(r"<[^<>]*>", "", text[len(kind) :])
    try:
        if kind == "Convex":
            return _hull(rest, place)
        if kind not in _SHAPES:
            raise SceneError(f"{place}: no shape is called {kind!r} here; known are Convex, {', '.join(_SHAPES)}")
        count, make = _SHAPES[kind]
        values = _numbers(re.sub(r"[A-Za-z]+\s*:", " ", rest))
        if len(values) != count:
            raise SceneError(f"{place}: {kind} takes {count} numbers, got {len(values)}: {' '.join(text.split())[:80]}")
        return make(*values)
    except InvalidShape as error:
        raise SceneError(f"{place}: {error}") from None


def _hull(text: str, place: str) -> Shape:
    """The hull of the points of a Convex; its faces are of no use to an exact answer."""
    if "v count" in text:
        raise SceneError(
            f"{place}: this FCL printed only how many vertices the Convex has, not where they are; FCL since 2023 "
            "prints them all, and collide.adapters.fuzzing.recorders writes pairs of a program down"
        )
    points = [_numbers(row) for row in re.findall(r"Vector3\s*\(([^()]*)\)", text)]
    if not points or any(len(point) != 3 for point in points):
        raise SceneError(f"{place}: a Convex without vertices: {' '.join(text.split())[:80]}")
    return ConvexHull(np.array(points))


def _pose(text: str, place: str) -> np.ndarray:
    values = _numbers(text)
    if len(values) != 16:
        raise SceneError(f"{place}: a pose has 4 × 4 numbers, got {len(values)}")
    return np.array(values).reshape(4, 4)


def answered(dump: FclDump, known: dict) -> list[str]:
    """What to tell about a dump: the pair, what FCL said of it, and what is proven.

    known : as `proofs.proof` gives it.
    """
    A, B = dump.case.bodies[:2]
    sentence = {True: "they meet", False: "they are apart", None: "whether they meet is not known"}[known["hit"]]
    if known["distance"] is not None:
        sentence += f": signed distance {known['distance']} m, by {known['by']}"
    elif known["lower"] is not None:
        sentence += f": signed distance within [{known['lower']!r}, {known['upper']!r}] m, by {known['by']}"
    message = [f"FCL: {dump.message}"] if dump.message else []
    return [f"A: {A.shape!r}", f"B: {B.shape!r}", *message, f"proven: {sentence}"]
