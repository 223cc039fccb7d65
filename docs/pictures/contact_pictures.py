"""The picture of docs/contacts.md: manifolds of pairs that rest on each other, as `collide.contacts` gives them.

    python docs/pictures/contact_pictures.py           # needs matplotlib; writes docs/pictures/contacts.png
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

import collide

matplotlib.use("Agg")
from matplotlib import pyplot
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

FILE = Path(__file__).parent / "contacts.png"
BLUE, RED, GREY = "#3b6ea5", "#c0504d", "#7a7a7a"
LIGHT = np.array([0.4, -0.5, 0.77])
#: Bodies are asked at rest, sunk by so much, and B is drawn lifted by so much [m], so that the contacts can be seen.
SUNK, LIFTED = 1e-4, 0.16


def triangles_of(shape: collide.Shape) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(shape, collide.Mesh):
        return np.asarray(shape.vertices), np.asarray(shape.faces)
    made = collide.tessellate(shape, tolerance=1e-3)
    return np.asarray(made.vertices), np.asarray(made.faces)


def sharp_edges(points: np.ndarray, faces: np.ndarray, all_edges: bool) -> np.ndarray:
    """(k, 2, 3) ends of edges between facets that are at an angle, or of all edges."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    sides: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(faces.tolist()):
        for k in range(3):
            i, j = sorted((face[k], face[(k + 1) % 3]))
            sides.setdefault((i, j), []).append(number)
    remaining = [
        edge for edge, both in sides.items()
        if all_edges or len(both) != 2 or normals[both[0]] @ normals[both[1]] < 0.9
    ]
    return points[np.array(remaining, dtype=int).reshape(-1, 2)]


def draw_body(axes, shape: collide.Shape, X: np.ndarray, colour: str, alpha: float) -> np.ndarray:
    """Its facets, shaded, and its edges; the corners drawn."""
    points, faces = triangles_of(shape)
    points = points @ X[:3, :3].T + X[:3, 3]
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    shade = np.clip(0.8 + 0.2 * normals @ LIGHT, 0, 1)[:, None] * np.array(matplotlib.colors.to_rgb(colour))
    faces_rgba = np.concatenate([shade, np.full((len(faces), 1), alpha)], axis=1)
    axes.add_collection3d(Poly3DCollection(corners, facecolors=faces_rgba, edgecolors="none"))
    edges = sharp_edges(points, faces, isinstance(shape, collide.Mesh))
    if len(edges):
        axes.add_collection3d(Line3DCollection(edges, colors=colour, linewidths=0.7, alpha=0.8))
    return points


def draw_contacts(axes, contacts: collide.Contacts) -> None:
    """Points of A, the same where B is drawn, dotted lines between them, and the normal from each point of A."""
    for row in contacts:
        a, b = row["point_a"], row["point_b"] + LIFTED * np.array([0, 0, 1.0])
        axes.plot(*np.stack([a, b]).T, color=GREY, linewidth=0.8, linestyle=":", zorder=8)
        axes.plot(*np.stack([a, a + 0.07 * row["normal"]]).T, color="black", linewidth=1.6, zorder=9)
    first = contacts.rows[:1]
    lift = np.array([0, 0, LIFTED])
    for points, colour in ((contacts.point_a, BLUE), (contacts.point_b + lift, RED)):
        axes.scatter(*points.T, color=colour, s=24, depthshade=False, zorder=10, edgecolors="black", linewidths=0.5)
    axes.scatter(*first["point_a"].T, s=90, facecolors="none", edgecolors="black", linewidths=1.0, zorder=11)


def scenes() -> dict[str, tuple[collide.Shape, np.ndarray, collide.Shape, np.ndarray]]:
    """Title to (A, X_WA, B, X_WB)."""
    table, X_T = collide.Box((0.6, 0.6, 0.12)), collide.pose((0, 0, -0.06))
    corners = [(-0.3, -0.3, 0), (0.3, -0.3, 0), (0.3, 0.3, 0), (-0.3, 0.3, 0)]
    floor = collide.Mesh(corners, [(0, 1, 2), (0, 2, 3)], solid=False)
    rng = np.random.default_rng(4)
    ring = np.array([(np.cos(a), np.sin(a)) for a in 2 * np.pi * (np.arange(7) + rng.uniform(-0.2, 0.2, 7)) / 7])
    ends = (0.2, -0.08), (0.11, 0.08)
    frustum = np.concatenate([np.column_stack([scale * ring, np.full(7, z)]) for scale, z in ends])
    quarter = 0.5 * np.pi
    return {
        title: (floor if A is floor else table, np.eye(4) if A is floor else X_T, B, collide.pose(place, rpy=rpy))
        for title, A, B, place, rpy in (
            ("a box on a box, turned", table, collide.Box((0.6, 0.6, 0.2)), (0, 0, 0.1), (0, 0, 0.6)),
            ("an edge on a face", table, collide.Box((0.3, 0.3, 0.3)), (0, 0, 0.15 * 2**0.5), (0.5 * quarter, 0, 0.4)),
            ("a hull on a face, over its edge", table, collide.ConvexHull(frustum), (0.2, -0.05, 0.08), (0, 0, 0.3)),
            ("a cylinder standing", table, collide.Cylinder(0.18, 0.25), (0, 0, 0.125), (0, 0, 0.2)),
            ("a cylinder lying", table, collide.Cylinder(0.12, 0.4), (0, 0, 0.12), (quarter, 0, 0.9)),
            ("a capsule lying, half over", table, collide.Capsule(0.1, 0.4), (0.2, 0, 0.1), (quarter, 0, 1.1)),
            ("a box over two triangles", floor, collide.Box((0.3, 0.25, 0.2)), (0.02, -0.01, 0.1), (0, 0, 0.35)),
            ("a ball", table, collide.Sphere(0.15), (0.05, 0, 0.15), (0, 0, 0)),
        )
    }


def main() -> None:
    figure = pyplot.figure(figsize=(14, 7.4))
    for number, (title, (A, X_WA, B, X_WB)) in enumerate(scenes().items()):
        axes = figure.add_subplot(2, 4, number + 1, projection="3d", computed_zorder=False)
        sunk = X_WB.copy()
        sunk[2, 3] -= SUNK
        contacts = collide.contacts(A, B, X_WA, sunk, margin=1e-3)
        lifted = X_WB.copy()
        lifted[2, 3] += LIFTED
        drawn = [draw_body(axes, A, X_WA, BLUE, 0.35), draw_body(axes, B, lifted, RED, 0.18)]
        draw_contacts(axes, contacts)
        points = np.concatenate(drawn)
        half = 0.5 * (points.max(axis=0) - points.min(axis=0)).max()
        middle = 0.5 * (points.max(axis=0) + points.min(axis=0))
        axes.set(**{f"{x}lim": (middle[k] - half, middle[k] + half) for k, x in enumerate("xyz")})
        axes.set_box_aspect((1, 1, 1), zoom=1.12)
        axes.view_init(elev=24, azim=-58)
        axes.set_axis_off()
        axes.set_title(f"{title}\n{len(contacts)} contact{'s' if len(contacts) > 1 else ''}", fontsize=10)
    figure.subplots_adjust(left=0, right=1, bottom=0, top=0.93, wspace=0, hspace=0.12)
    figure.savefig(FILE, dpi=90)
    print(f"written: {FILE}")


if __name__ == "__main__":
    main()
