"""Bad meshes: each kind of corruption of each mesh is refused with the row to blame, or answered rightly.

    COLLIDE_CORRUPTIONS=200 python -m pytest tests/mesh/test_corrupted_meshes.py -m slow -s    # an hour or two
"""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path
from zlib import crc32

import mesh_corruptions as corruptions
import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere

from collide import InvalidShape, Mesh
from collide.errors import CollideError

BASES = {"bumpy sphere": bumpy_sphere(120), "ring": block_ring(), "box": box()}
#: Meshes of every sort: soups, open ones, several parts, STL, OBJ and Collada. Those of at most 2,000 facets are taken.
SAMPLE = (
    "duck.obj", "cube.obj", "plane.obj", "torus/torus_textured.obj", "teddy2_VHACD_CHs.obj", "sphere_smooth.obj",
    "random_urdfs/000/000.obj",
    "random_urdfs/503/503.obj", "kuka_iiwa/meshes/link_0.stl", "franka_panda/meshes/collision/finger.obj",
    "table/table.obj",
)
PER_MESH = 15


def judged(name: str, vertices, faces, k: int, kind: str) -> corruptions.Said:
    """One case; what fails names it so that it can be asked again."""
    rng = np.random.default_rng([crc32(name.encode()), k])
    said = corruptions.ask(
        rng, corruptions.spoil(rng, np.array(vertices, dtype=float), np.array(faces), kind), deep=k % 9 == 0
    )
    assert not said.wrong, f"judged({name!r}, …, {k}, {kind!r}): {said.wrong}"
    return said


@pytest.mark.many(7)
@pytest.mark.parametrize("kind", corruptions.KINDS)
def test_corruptions_of_small_meshes(kind):
    outcomes = Counter()
    for name, (vertices, faces) in BASES.items():
        for k in range(6):
            outcomes[judged(f"{name} {kind}", vertices, faces, k, kind).outcome] += 1
    refused = kind in ("NaN vertices", "ids out of range")
    assert outcomes["refused"] == (18 if refused else 0), outcomes
    assert refused or (outcomes["apart"] >= 3 and outcomes["hit"] >= 3), outcomes


def whole(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """All triangles of a file as one mesh."""
    from collide.scenes.loaders.triangles import read_triangles

    parts = [(v, f) for _, v, f in read_triangles(path)[0] if len(f)]
    starts = np.cumsum([0, *(len(v) for v, _ in parts)])
    vertices = np.concatenate([np.empty((0, 3)), *(v for v, _ in parts)])
    return vertices, np.concatenate([np.empty((0, 3), int), *(f + s for (_, f), s in zip(parts, starts))])


@pytest.mark.slow
def test_every_mesh_of_pybullet_data():
    """All files, the mesh as it is and so many corruptions of each."""
    pybullet_data = pytest.importorskip("pybullet_data", reason="pybullet brings the meshes")
    pytest.importorskip("trimesh", reason="trimesh reads them")
    root, outcomes, each = Path(pybullet_data.getDataPath()), Counter(), int(os.environ.get("COLLIDE_CORRUPTIONS", "2"))
    for path in sorted(p for p in root.rglob("*") if p.suffix.lower() in (".obj", ".stl", ".dae")):
        name = path.relative_to(root).as_posix()
        try:
            vertices, faces = whole(path)
        except CollideError as error:
            print(f"{name}: {error}")
            continue
        for k in range(each + 1 if len(faces) else 0):
            kind = corruptions.KINDS[0 if k == 0 else 1 + k % (len(corruptions.KINDS) - 1)]
            outcomes[judged(name, vertices, faces, k, kind).outcome] += 1
    print(outcomes)
    assert outcomes["hit"] and outcomes["apart"]


@pytest.mark.slow
def test_meshes_of_pybullet_data():
    pybullet_data = pytest.importorskip("pybullet_data", reason="pybullet brings the meshes")
    pytest.importorskip("trimesh", reason="trimesh reads them")
    root, outcomes, solids, found = Path(pybullet_data.getDataPath()), Counter(), Counter(), 0
    for name in SAMPLE:
        if not (root / name).is_file():
            continue
        vertices, faces = whole(root / name)
        if len(faces) > 2000:
            continue
        found += 1
        for k in range(PER_MESH):
            kind = corruptions.KINDS[k % len(corruptions.KINDS)]
            said = judged(name, vertices, faces, k, kind)
            outcomes[said.outcome] += 1
            solids[said.solid] += said.outcome != "refused"
    assert found >= 6, f"pybullet_data has other meshes: {found} of {SAMPLE}"
    total = sum(outcomes.values())
    assert outcomes["apart"] > total / 8 and outcomes["hit"] > total / 8 and outcomes["refused"] >= 2 * found - 4, (
        outcomes
    )
    assert outcomes["inside"] >= 3 and min(solids.values()) > total / 10, (outcomes, solids)


# --- what is refused names the row --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda v, f: v.__setitem__((5, 1), np.nan), r"vertices\[5, 1\] is nan"),
        (lambda v, f: v.__setitem__((0, 2), 1e51), r"vertices\[0, 2\] is 1e\+51"),
        (lambda v, f: f.__setitem__((7, 0), 8), r"faces\[7\] is \[8, .*vertices 0 … 7 \(1 such facet\)"),
        (lambda v, f: f.__setitem__((3, 2), -1), r"faces\[3\] is .*\(1 such facet\)"),
    ],
)
def test_refusals_name_the_row(spoil, message):
    vertices, faces = (array.copy() for array in box())
    spoil(vertices, faces)
    with pytest.raises(InvalidShape, match=message):
        Mesh(vertices, faces)


def test_solid_true_names_the_facets():
    vertices, faces = box()
    for spoilt, defect in (
        (faces[1:], "open edges"),
        (np.concatenate([faces[:5], faces[5:6, ::-1], faces[6:]]), "inconsistent orientation"),
        (np.concatenate([faces, faces[3:4]]), "duplicate facets"), (faces[:, ::-1], "inside out"),
    ):
        with pytest.raises(InvalidShape, match=rf"{defect} \(.*facets? \d+"):
            Mesh(vertices, spoilt, solid=True)


# --- the judge ------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_wrong_answer_would_be_found(monkeypatch):
    """The engine's hits turned round, its gaps moved, its solids taken for surfaces: each shows."""
    honest = corruptions.collide, corruptions.distance

    def found(n: int = 30) -> int:
        wrong = 0
        for k in range(n):
            rng = np.random.default_rng(k)
            wrong += bool(corruptions.ask(rng, corruptions.spoil(rng, *map(np.array, BASES["ring"]), "as it is")).wrong)
        return wrong

    assert found() == 0
    monkeypatch.setattr(corruptions, "collide", lambda *pair, **options: not honest[0](*pair, **options))
    assert found() == 30
    monkeypatch.setattr(corruptions, "collide", honest[0])

    class Off:
        def __init__(self, r):
            self.lower, self.upper, self.hit, self.certified = r.lower + 1e-9, r.upper + 1e-9, r.hit, r.certified

    monkeypatch.setattr(corruptions, "distance", lambda *pair, **options: Off(honest[1](*pair, **options)))
    assert found() > 20
    monkeypatch.setattr(corruptions, "distance", honest[1])

    class Surface(Mesh):
        def __init__(self, vertices, faces):
            super().__init__(vertices, faces, solid=False)

    monkeypatch.setattr(corruptions, "Mesh", Surface)
    assert found(3) == 3
