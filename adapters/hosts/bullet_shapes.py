"""Shapes of a pybullet client's bodies, as its interface gives them back.

Primitives come as their lengths. Hulls come as the vertices that Bullet keeps, snapped to its grid, so that both
engines ask about the same points. Meshes of triangles are not given back at all: those of URDF files are read from the
file that pybullet names; of others the caller must say what they are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from collide.adapters.hosts.quaternion_poses import pose_of
from collide.base.given_files import LARGEST_MESH, read_bytes
from collide.errors import CollideError, UnsupportedQuery
from collide.scenes.loaders.mesh_file import read_mesh
from collide.shapes import Box, Capsule, Compound, ConvexHull, Cylinder, Halfspace, Mesh, Shape, Sphere

#: What Bullet adds around hulls and triangles unless it is changed [m].
DEFAULT_MARGIN = 0.001
#: The name pybullet gives to what was made from arrays.
NO_FILE = "unknown_file"
#: What getDynamicsInfo calls the type of a soft body.
_SOFT = 3
#: A collider without shapes has a box of at most so much, by its margin [m].
_EMPTY = 4.0 * DEFAULT_MARGIN
#: Lengths of file vertices and of Bullet's differ by its grid and by single precision: this part of the size.
_GRID = 1e-3


class Collider(NamedTuple):
    """What one link of one body collides with.

    shape : in its frame S.   X_BS : (4, 4) in the collider's frame B, at the link's centre of mass; None where equal.
    margin : of triangles alone, which Bullet keeps around them [m]: taken off distances to all but spheres.
    note : what of it is an approximation; empty where nothing is.
    """

    shape: Shape
    X_BS: np.ndarray | None
    margin: float
    note: str


class _Record(NamedTuple):
    """One row of getCollisionShapeData: the number of the child, and its fields."""

    child: int
    kind: int
    lengths: tuple[float, float, float]
    file: str
    X_BS: np.ndarray


class ShapeReader:
    """Shapes of one client; equal ones are one object.

    pybullet : the module.   margins : "none", or "bullet" for hulls and triangles grown by what Bullet adds.
    """

    def __init__(self, pybullet: Any, client: int, margins: str):
        self._pybullet, self._client, self._margin = pybullet, client, DEFAULT_MARGIN if margins == "bullet" else 0.0
        self._shapes: dict[tuple, Shape] = {}

    def collider(self, body: int, link: int, replacement: Shape | None = None) -> Collider | None:
        """The collider of a link, None where it has none. Raises UnsupportedQuery, saying why it cannot be read.

        replacement : a shape in the collider's frame, to be taken for what pybullet says.
        """
        margin = self._margin
        if replacement is not None:
            return Collider(replacement, None, margin if _is_triangles(replacement) else 0.0, "")
        records = self._records(body, link)
        if not records:
            low, high = self._pybullet.getAABB(body, link, self._client)
            if max(b - a for a, b in zip(low, high)) > _EMPTY:
                raise UnsupportedQuery("pybullet does not give back its shape (a height field?)")
            return None
        notes: list[str] = []
        parts = [part for record in records for part in self._parts(body, link, record, len(records), notes)]
        is_mesh = len(parts) == 1 and isinstance(parts[0][0], Mesh)
        if margin and not is_mesh and any(isinstance(shape, Mesh) for shape, _ in parts):
            notes.append("Bullet's margin around its triangles is left out")
        if len(parts) == 1:
            shape, X_BS = parts[0]
            at_rest = (X_BS == np.eye(4)).all()
            return Collider(shape, None if at_rest else X_BS, margin if is_mesh else 0.0, "; ".join(notes))
        key = ("union", *((id(shape), X.tobytes()) for shape, X in parts))  # all of them are in the table below
        return Collider(self._one_of(key, lambda: Compound(parts)), None, 0.0, "; ".join(notes))

    def shared(self, shape: Shape) -> Shape:
        """The first shape that was equal to this one."""
        return self._one_of(("equal", shape), lambda: shape)

    def _one_of(self, key: tuple, make) -> Shape:
        if key not in self._shapes:
            self._shapes[key] = make()
        return self._shapes[key]

    def _records(self, body: int, link: int) -> list[_Record]:
        try:
            rows = self._pybullet.getCollisionShapeData(body, link, self._client)
        except self._pybullet.error:
            info = self._pybullet.getDynamicsInfo(body, link, self._client)
            what = "a soft body" if info[10] == _SOFT else "a body made with useMaximalCoordinates"
            raise UnsupportedQuery(f"pybullet does not give back the shape of {what}") from None
        # Ids of the second and later rows are memory as it was found: they are not looked at.
        return [
            _Record(k, row[2], row[3], row[4].decode(errors="replace"), pose_of(row[5], row[6]))
            for k, row in enumerate(rows or ())
        ]

    def _parts(
        self, body: int, link: int, record: _Record, n_records: int, notes: list[str]
    ) -> list[tuple[Shape, np.ndarray]]:
        """Shapes and their poses of one record."""
        p, lengths, X_BS = self._pybullet, record.lengths, record.X_BS
        if record.kind == p.GEOM_MESH:
            return self._mesh(body, link, record, n_records, notes)
        if record.kind == p.GEOM_SPHERE:
            shape: Shape = Sphere(lengths[0])
        elif record.kind == p.GEOM_BOX:
            shape = Box(lengths)
        elif record.kind == p.GEOM_CAPSULE:
            shape = Capsule(lengths[1], lengths[0])
        elif record.kind == p.GEOM_CYLINDER:
            shape = Cylinder(lengths[1], lengths[0])
        elif record.kind == p.GEOM_PLANE:
            shape = Halfspace(lengths, 0.0)
        else:
            raise UnsupportedQuery(f"its shape has a kind that is not known here: {record.kind}")
        return [(self.shared(shape), X_BS)]

    # --- meshes ---------------------------------------------------------------------------------

    def _mesh(
        self, body: int, link: int, record: _Record, n_records: int, notes: list[str]
    ) -> list[tuple[Shape, np.ndarray]]:
        """Hulls with the vertices that Bullet has, a union of hulls, or the triangles of a file.

        An OBJ file is a compound of one hull for each of its groups; where it stands in another compound, its hulls
        past the first are not given back one by one, and are made from the file.
        """
        is_compound = n_records > 1 or record.file.lower().endswith(".obj") or not (record.X_BS == np.eye(4)).all()
        radius = self._margin
        if radius and not is_compound:  # of what a compound holds it cannot be asked, nor changed
            radius = float(self._pybullet.getDynamicsInfo(body, link, self._client)[11])
        if record.file == NO_FILE or not record.file.lower().endswith(".obj"):
            points = self._vertices(body, link, -1 if n_records == 1 else record.child)
            if len(points):
                return [self._hull(points, radius)]
            if record.file == NO_FILE:
                raise UnsupportedQuery("a mesh of triangles made from arrays, which pybullet does not give back")
            return [self._triangles(record)]
        points = self._vertices(body, link, -1) if n_records == 1 else np.empty((0, 3))
        if n_records == 1 and not len(points):
            return [self._triangles(record)]
        hulls: list[np.ndarray] = []
        while n_records == 1 and sum(map(len, hulls)) < len(points):
            hulls.append(self._vertices(body, link, len(hulls)))
            if not len(hulls[-1]):
                break
        if hulls and sum(map(len, hulls)) == len(points):
            return [self._hull(hull, radius) for hull in hulls]
        return self._hulls_of_file(record, points, radius, notes)

    def _hull(self, points: np.ndarray, radius: float) -> tuple[Shape, np.ndarray]:
        key = "hull", points.tobytes(), radius
        return self._one_of(key, lambda: ConvexHull(points, radius=radius)), np.eye(4)

    def _hulls_of_file(
        self, record: _Record, points: np.ndarray, radius: float, notes: list[str]
    ) -> list[tuple[Shape, np.ndarray]]:
        """A hull for every group of an OBJ file; where that is not the file Bullet read, one hull of all points."""
        X = record.X_BS
        try:
            groups = [
                group * np.array(record.lengths) @ X[:3, :3].T + X[:3, 3] for group in obj_groups(Path(record.file))
            ]
        except OSError as error:
            groups, why = [], f"{record.file} cannot be read ({error.strerror})"
        else:
            why = f"{record.file} is not what it was read from"
        if groups and (not len(points) or _same_boxes(np.concatenate(groups), points)):
            return [self._hull(group, radius) for group in groups]
        if not len(points):
            raise UnsupportedQuery(why)
        notes.append(f"a union of hulls is one hull here, since {why}")
        return [self._hull(points, radius)]

    def _triangles(self, record: _Record) -> tuple[Shape, np.ndarray]:
        """The triangles of a file, without an inside, as Bullet takes them."""
        key = "file", record.file, record.lengths

        def make() -> Shape:
            try:
                file = read_mesh(Path(record.file))
            except CollideError as error:
                raise UnsupportedQuery(f"a mesh of triangles whose file cannot be read: {error}") from None
            facets = [part.facets for part in file.parts if part.facets is not None]
            first = np.cumsum([0, *(len(part.points) for part in file.parts[:-1])])
            points = np.concatenate([part.points for part in file.parts]) * np.array(record.lengths)
            return Mesh(points, np.concatenate([f + n for f, n in zip(facets, first)]), solid=False)

        return self._one_of(key, make), record.X_BS

    def _vertices(self, body: int, link: int, child: int) -> np.ndarray:
        """(n, 3) of all hulls of a link, or of one child, in the collider's frame; none of other shapes."""
        try:
            _, points = self._pybullet.getMeshData(body, link, child, physicsClientId=self._client)
        except self._pybullet.error:
            return np.empty((0, 3))
        return np.array(points, dtype=np.float64).reshape(-1, 3)


def obj_groups(path: Path) -> list[np.ndarray]:
    """Vertices (n, 3) of each group or object of an OBJ file that has faces, as Bullet's reader parts them.

    Raises OSError.
    """
    vertices: list[list[float]] = []
    groups: list[set[int]] = [set()]
    for line in read_bytes(path, LARGEST_MESH, "mesh").decode(errors="replace").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            vertices.append([float(word) for word in words[1:4]])
        elif words[0] == "f":
            ids = [int(word.split("/")[0]) for word in words[1:]]
            groups[-1].update(k - 1 if k > 0 else len(vertices) + k for k in ids)
        elif words[0] in ("g", "o") and groups[-1]:
            groups.append(set())
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    return [points[sorted(group)] for group in groups if group]


def _is_triangles(shape: Shape) -> bool:
    if isinstance(shape, Compound):
        return all(_is_triangles(item) for item, _ in shape.items)
    return isinstance(shape, Mesh)


def _same_boxes(A: np.ndarray, B: np.ndarray) -> bool:
    """Whether two point sets have the same box, but for Bullet's grid."""
    size = np.ptp(B, axis=0).max()
    low, high = A.min(axis=0) - B.min(axis=0), A.max(axis=0) - B.max(axis=0)
    return bool(max(np.abs(low).max(), np.abs(high).max()) <= _GRID * size)
