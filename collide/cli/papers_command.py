"""The command papers: the structures of three papers, each at work on a small case."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from collide.cli.files import write_json

EPILOG = """examples:
  collide papers
  collide papers --paper erickson
  collide papers --json - | jq '.structures[].found'

Each line is computed as you look, on seeded bodies: a structure, and what it
came to. The papers, and the pages that say what is proven, what is built,
what was found wrong in the text, and what it costs:
  barba-langerman  Optimal detection of intersections between convex polyhedra
                   docs/barba-langerman.md
  erickson         Local polyhedra and geometric graphs
                   docs/locality.md
  barba-mulzer     Asymmetric convex intersection testing
                   docs/polytopes.md

exit status: 0 done, 2 error"""


class Structure(NamedTuple):
    """A structure of a paper, its section, and a function whose text is a line with the result of a small case."""

    paper: str
    section: str
    name: str
    demonstrate: Callable[[], str]


def add_arguments(parser) -> None:
    """Those of its own."""
    papers = sorted({structure.paper for structure in STRUCTURES})
    parser.add_argument("--paper", choices=papers, help="the structures of this paper alone")


def run(args) -> int:
    """Show every structure with its demonstration; 0."""
    from collide.reports import terminal

    rows = list(demonstrations(args.paper))
    if args.json:
        write_json({"structures": rows}.items(), args.json)
    if args.json != "-" and not args.quiet:
        paper = ""
        for row in rows:
            if row["paper"] != paper:
                paper = row["paper"]
                terminal.write_text(f"{paper}\n")
            terminal.write_text(f"  {row['section']:<8} {row['structure']}: {row['found']}\n")
    return 0


def demonstrations(paper: str | None = None) -> Iterator[dict[str, str]]:
    """A row for each structure, of one paper or of all."""
    for structure in STRUCTURES:
        if paper in (None, structure.paper):
            yield {
                "paper": structure.paper, "section": structure.section, "structure": structure.name,
                "found": structure.demonstrate(),
            }


def _ball(n: int, seed: int):
    import numpy as np

    points = np.random.default_rng(seed).normal(size=(n, 3))
    return points / np.sqrt(np.square(points).sum(axis=1))[:, None]


def _plank():
    """A mesh of twelve facets."""
    import collide

    return collide.Mesh(*collide.tessellate(collide.Box((10.0, 1.0, 0.1)))[:2])


def _shifted(x: float, d: int = 3):
    import numpy as np

    X = np.eye(d + 1)
    X[0, d] = x
    return X


def _polygons() -> str:
    import numpy as np

    import collide

    angles = 2.0 * np.pi * np.arange(1000) / 1000
    A = collide.ConvexPolygon(np.column_stack([np.cos(angles), np.sin(angles)]))
    X_WB = _shifted(2.0 + 1e-9, 2)
    r = collide.polytopes.polygons_meet(A, A, np.eye(3), X_WB)
    collide.polytopes.verify_polygons(A, A, np.eye(3), X_WB, r.certificate(0))
    hit, rounds, read = (np.ravel(values)[0] for values in (r.hit, r.rounds, r.vertices_read))
    return f"two of 1,000 corners {_met(hit)}: {rounds} rounds, {read} corners read, proof checked"


def _hierarchy() -> str:
    import numpy as np

    import collide
    from collide.papers.hierarchies.hierarchy_queries import walk_body

    angles = np.sort(np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, 1000))
    ring = np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    points = np.concatenate([ring, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    levels = walk_body(collide.ConvexHull(points)).hierarchy.hierarchy
    first, *others = (int(levels.degrees(level).max()) for level in range(levels.depth))
    return f"a bipyramid, degree {first:,} at a tip, has {levels.depth} levels, above it degrees ≤ {max(others)}"


def _walk() -> str:
    import numpy as np

    import collide

    A, B = (collide.ConvexHull(_ball(500, seed)) for seed in (2, 3))
    X_WB = _shifted(1.99)
    r = collide.walk(A, B, np.eye(4), X_WB)
    collide.verify(A, B, np.eye(4), X_WB, r)
    row = r.rows[0]
    return f"balls of 500 vertices {_met(r.hit[0])}: {row['rounds']} rounds, {row['tests']} tests, proof checked"


def _trees() -> str:
    import numpy as np

    from collide import polytopes

    points = np.random.default_rng(4).normal(size=(100, 4))
    normals, offsets = np.vstack((np.eye(4), -np.eye(4))), np.ones(8)
    X = _shifted(3.0, 4)
    A, B = polytopes.HierarchicalTree(points), polytopes.HierarchicalTree(normals=normals, offsets=offsets)
    r = polytopes.trees_meet(A, B, X)
    polytopes.verify_trees(points, normals, offsets, r, X)
    return f"100 points and 8 half-spaces of R⁴ {_met(r.hit)}; rounds: {r.counters['rounds']}, proof checked"


def _locality() -> str:
    measures = _plank().locality()
    local = measures.local_stretches[0]
    return f"a plank of 10 × 1 × 0.1 has global stretch {measures.global_stretch:.3g}, local {local:.3g}"


def _localised() -> str:
    made = _plank().localised(10.0).mesh
    return f"the plank, cut until its local stretch is 10, has {len(made.faces)} facets"


def _graded_tree() -> str:
    from collide.papers.hierarchies.tree_figures import tree_figures

    figures = tree_figures(_plank().localised(10.0).mesh)
    return (
        f"over these {figures.graded_size} nodes, at most {figures.node_bound} allowed, "
        f"finest level {figures.graded_level}, at most {figures.level_bound} allowed"
    )


def _boolean() -> str:
    import numpy as np

    import collide

    box = collide.Box((1.0, 1.0, 1.0))
    made = collide.boolean(box, box, np.eye(4), _shifted(0.5), "union")
    assert made.mesh is not None
    return f"two boxes, joined, have volume {made.mesh.volume:.3g} and {len(made.mesh.faces)} facets"


def _partition() -> str:
    import collide

    tree = collide.SpacePartition(_plank().localised(10.0).mesh)
    size = tree.size
    return f"its facets cut space into {size.cells} convex cells, {size.inside} inside, at depth {size.depth}"


def _pruning(algorithm: str, n: int, d: int) -> str:
    import numpy as np

    from collide import polytopes

    rng = np.random.default_rng(5)
    points = rng.normal(size=(n, d))
    normals = rng.normal(size=(n, d))
    offsets = np.sqrt(np.square(normals).sum(axis=1))
    points[:, 0] += 6.0
    r = polytopes.meets(points, normals, offsets, algorithm=algorithm)
    polytopes.verify(points, normals, offsets, r)
    read = int(r.counters["points_read"]) + int(r.counters["halfspaces_read"])
    return f"{n:,} points, {n:,} half-spaces of R^{d} {_met(r.hit)}: {read:,} rows read, proof checked"


def _met(hit) -> str:
    return "meet" if hit else "are apart"


STRUCTURES = (
    Structure("barba-langerman", "§2", "two convex polygons", _polygons),
    Structure("barba-langerman", "§4", "hierarchies of bounded degree", _hierarchy),
    Structure("barba-langerman", "§3, §5", "the walk between a body and a polar", _walk),
    Structure("barba-langerman", "§6", "hierarchical trees", _trees),
    Structure("erickson", "§2.1, §8", "measures of locality", _locality),
    Structure("erickson", "§8", "meshes made local", _localised),
    Structure("erickson", "§3.2", "the graded box-tree", _graded_tree),
    Structure("erickson", "§3.3", "booleans of polyhedra", _boolean),
    Structure("erickson", "§5", "binary space partitions", _partition),
    Structure("barba-mulzer", "§4", "pruning by nets (ACIT)", lambda: _pruning("acit", 1000, 3)),
    Structure("barba-mulzer", "§2", "Clarkson's sampling", lambda: _pruning("lp-type", 1000, 3)),
    Structure("barba-mulzer", "§2", "the default", lambda: _pruning("active-set", 1000, 3)),
)
