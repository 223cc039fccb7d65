"""The bytes of the engine's answers, hashed: what a rewrite must not change.

    python tests/golden.py                # compares with tests/golden.json; tells the groups that moved
    python tests/golden.py --part 2/6     # the second sixth of the families
    python tests/golden.py --write        # after a change that is meant: a commit of its own that says which rows
    moved, and why
    python tests/golden.py --keep FILE    # questions and answers themselves, for another machine or another Python:
    python tests/golden.py --against FILE # asks the questions of the file; tells where bytes differ, and numbers

A group is a kind of question about one family of pairs, in one way of asking. Inputs are hashed as well: they come from
random generators and from the C library's sines, and where they are others the answers cannot be compared.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import math
import os
import pickle
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

# Questions are drawn with products of matrices, whose last bits are those of BLAS's kernel: on a processor with AVX-512
# 144 of 312 groups asked other doubles than were kept, and could not be compared.
os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")

import numpy as np

import collide
from collide.scenes.families import generate, mesh_names, names

FILE = Path(__file__).with_name("golden.json")
#: Cases of a family, and random pairs of all kinds of shapes.
EACH, DRAWN = 3, 240
SEED = 19
#: How far numbers of two machines may differ.
ROUNDING = 2.0**-40


class Pair(NamedTuple):
    A: collide.Shape
    B: collide.Shape
    X_WA: np.ndarray
    X_WB: np.ndarray


class Digest:
    """Of arrays, records field by field (what pads them is nobody's), numbers and text."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()

    def add(self, value) -> None:
        if hasattr(value, "dtype") and value.dtype.names:
            for name in value.dtype.names:
                self.add(value[name])
        elif isinstance(value, (np.ndarray, np.generic)):
            self._sha.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
        elif isinstance(value, (list, tuple)):
            for one in value:
                self.add(one)
        else:
            self._sha.update(repr(value).encode())

    def text(self) -> str:
        return self._sha.hexdigest()[:16]

    @classmethod
    def of(cls, answers: list) -> str:
        """Of a list of answers."""
        digest = cls()
        digest.add(answers)
        return digest.text()


# --- pairs --------------------------------------------------------------------------------------


def families() -> Iterator[tuple[str, list[Pair]]]:
    """(name, pairs) of every family of the study, and of random pairs by kinds of shapes."""
    for name in (*names(), *mesh_names()):
        yield name, [Pair(*case.shapes()) for case in generate(name, EACH, SEED)]
    import soak_pairs

    drawn = [soak_pairs.draw(SEED, number, 1e3) for number in range(DRAWN)]
    meshed, curved = set(soak_pairs.MESHES), set(soak_pairs.CURVED)
    groups: dict[str, list[Pair]] = {}
    for case in drawn:
        kinds = set(case.kinds)
        name = (
            "meshes"
            if kinds & meshed
            else "compounds"
            if "compound" in kinds
            else "curved"
            if kinds & curved
            else "polytopes"
        )
        groups.setdefault(f"drawn: {name}", []).append(Pair(case.A, case.B, case.X_WA, case.X_WB))
    yield from groups.items()


def _asked_of(pairs: list[Pair]) -> str:
    """A hash of the questions, by what shapes are made from."""
    digest = Digest()
    for pair in pairs:
        for shape in (pair.A, pair.B):
            digest.add([_made_from(shape)])
        digest.add([pair.X_WA, pair.X_WB])
    return digest.text()


def _made_from(shape) -> list:
    if isinstance(shape, (list, tuple)):
        return [_made_from(one) for one in shape]
    if isinstance(shape, collide.Shape):
        return [type(shape).__name__, *(_made_from(getattr(shape, field)) for field in shape._fields)]
    return shape


# --- ways of asking -----------------------------------------------------------------------------


def _answer(ask: Callable, *arguments, **options):
    """What is answered, or the kind of error."""
    try:
        found = ask(*arguments, **options)
    except collide.CollideError as error:
        return type(error).__name__
    return found.rows if hasattr(found, "rows") else np.asarray(found)


def _batch(pair: Pair) -> tuple[np.ndarray, np.ndarray]:
    """Five pairs of poses about the one given."""
    shifts = np.array([0.0, 1.0, -1.0, 1e-9, 3.0])[:, None] * (pair.X_WB[:3, 3] - pair.X_WA[:3, 3])
    X_WB = np.repeat(pair.X_WB[None], len(shifts), axis=0)
    X_WB[:, :3, 3] += shifts
    return pair.X_WA[None], X_WB


def _single(pair):
    yield _answer(collide.collide, *pair)
    yield _answer(collide.distance, *pair)
    yield _answer(collide.distance, *pair, signed=False)


def _swapped(pair):
    yield _answer(collide.collide, pair.B, pair.A, pair.X_WB, pair.X_WA)
    yield _answer(collide.distance, pair.B, pair.A, pair.X_WB, pair.X_WA)


def _batched(pair):
    X_WA, X_WB = _batch(pair)
    for threads in (1, 2):
        yield _answer(collide.collide, pair.A, pair.B, X_WA, X_WB, threads=threads)
        yield _answer(collide.distance, pair.A, pair.B, X_WA, X_WB, threads=threads)
    yield _answer(collide.distance, pair.A, pair.B, X_WA, X_WB, max_distance=0.01)


def _contacts(pair):
    yield _answer(collide.contacts, *pair)
    yield _answer(collide.contacts, *pair, margin=0.01)


def _certificates(pair):
    try:
        certificate = collide.distance(*pair).certificate
    except collide.CollideError as error:
        certificate = type(error).__name__
    yield repr(certificate)


WAYS: dict[str, Callable] = {
    "single": _single, "swapped": _swapped, "batch": _batched, "contacts": _contacts, "certificate": _certificates,
}


def _in_a_list(pairs: list[Pair]) -> Iterator:
    """All pairs of a family in one call, and as bodies of one World."""
    A, B = [pair.A for pair in pairs], [pair.B for pair in pairs]
    X_WA, X_WB = np.array([pair.X_WA for pair in pairs]), np.array([pair.X_WB for pair in pairs])
    yield _answer(collide.collide, A, B, X_WA, X_WB)
    yield _answer(collide.distance, A, B, X_WA, X_WB)
    world = collide.World()
    for pair in pairs[:12]:
        world.add(pair.A, pair.X_WA)
        world.add(pair.B, pair.X_WB)
    for ask in (world.collides, world.collisions, lambda: world.distances(max_distance=0.1)):
        yield _answer(ask)


def answered(pairs: list[Pair]) -> Iterator[tuple[str, list]]:
    """(way of asking, answers) of a family."""
    for way, answers in WAYS.items():
        yield way, [list(answers(pair)) for pair in pairs]
    yield "list and World", list(_in_a_list(pairs))


def groups(part: int = 0, parts: int = 1) -> Iterator[tuple[str, str, str]]:
    """(name, hash of the questions, hash of the answers) of every ``parts``-th family."""
    for family, pairs in itertools.islice(families(), part, None, parts):
        asked = _asked_of(pairs)
        for way, answers in answered(pairs):
            yield f"{family}: {way}", asked, Digest.of(answers)


# --- two machines -------------------------------------------------------------------------------


def keep(file: Path, part: int, parts: int) -> None:
    """Questions and answers themselves."""
    chosen = itertools.islice(families(), part, None, parts)
    kept = {family: (pairs, dict(answered(pairs))) for family, pairs in chosen}
    file.write_bytes(pickle.dumps(kept))
    print(f"{len(kept)} families kept")


def against(file: Path, part: int, parts: int) -> bool:
    """Whether this machine answers the questions of a file as the file does: texts, integers and booleans without
    exception, numbers bit by bit or within `ROUNDING`, which takes products of matrices by another BLAS."""
    kept = pickle.loads(file.read_bytes())
    equal, others = 0, []
    for family, (pairs, known) in itertools.islice(kept.items(), part, None, parts):
        for way, answers in answered(pairs):
            if Digest.of(answers) == Digest.of(known[way]):
                equal += 1
                continue
            others.append(_difference(list(_leaves(answers)), list(_leaves(known[way]))))
            print(f"{family}: {way}: numbers differ by {others[-1]:.2g}", flush=True)
    far = sum(difference > ROUNDING for difference in others)
    print(f"{equal} groups with equal bytes, {len(others) - far} with equal values but for rounding, {far} with others")
    return bool(equal) and not far


def _leaves(value) -> Iterator:
    """Arrays, also of records, and texts."""
    if isinstance(value, (list, tuple)):
        for one in value:
            yield from _leaves(one)
    else:
        yield np.asarray(value)


def _difference(found: list, known: list) -> float:
    """How far numbers differ, in metres or in units of their own sizes, whichever are larger; infinite where anything
    else differs."""
    if [(one.shape, one.dtype.names) for one in found] != [(one.shape, one.dtype.names) for one in known]:
        return math.inf
    return max(map(_apart, found, known), default=0.0)


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    """`_difference` of two arrays of a shape. Rows with a wide proven interval, as the depths of compounds have, are
    answers of a search: the intervals must meet."""
    if one.dtype.names:
        if {"lower", "upper", "hit"} <= {*one.dtype.names}:
            if (one["lower"] > other["upper"]).any() or (other["lower"] > one["upper"]).any():
                return math.inf
            wide = (one["upper"] - one["lower"] > ROUNDING) & (other["upper"] - other["lower"] > ROUNDING)
            if (one["hit"] != other["hit"]).any():
                return math.inf
            one, other = one[~wide], other[~wide]
        return max(_apart(one[name], other[name]) for name in one.dtype.names)
    if np.array_equal(one, other, equal_nan=one.dtype.kind == other.dtype.kind == "f"):
        return 0.0
    if one.dtype.kind != "f" or other.dtype.kind != "f" or (np.isnan(one) != np.isnan(other)).any():
        return math.inf
    differ = ~(np.isnan(one) | (one == other))
    one, other = one[differ], other[differ]
    return float(np.nan_to_num(np.abs(one - other) / np.maximum(1.0, np.abs(other)), nan=math.inf).max())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="keep what the engine answers now")
    parser.add_argument("--part", default="1/1", metavar="K/N", help="the K-th of N parts of the families")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="write questions and answers, for --against")
    parser.add_argument("--against", type=Path, metavar="FILE", help="ask the questions of a file, compare the answers")
    given = parser.parse_args()
    part, parts = (int(number) for number in given.part.split("/"))
    if not 1 <= part <= parts or (given.write and parts > 1):
        parser.error(f"--part: {given.part} is no part of all families, or written by itself")
    sys.path[:0] = [str(Path(__file__).with_name(folder)) for folder in ("soak", "oracles")]
    if given.keep is not None:
        keep(given.keep, part - 1, parts)
        return
    if given.against is not None:
        sys.exit(not against(given.against, part - 1, parts))
    found = {name: [asked, told] for name, asked, told in groups(part - 1, parts)}
    if given.write:
        FILE.write_text(json.dumps(found, indent=0) + "\n", encoding="utf-8")
        print(f"{len(found)} groups written")
        return
    kept = json.loads(FILE.read_text(encoding="utf-8"))
    others = [name for name in found if kept.get(name, [""])[0] != found[name][0]]
    moved = [name for name in found if name not in others and kept[name] != found[name]]
    for name in moved:
        print(f"moved: {name}")
    gone = len(set(kept) - set(found)) if parts == 1 else 0
    print(f"{len(found)} groups, {len(moved)} moved, {len(others)} with other questions, {gone} gone")
    sys.exit(bool(moved))


if __name__ == "__main__":
    main()
