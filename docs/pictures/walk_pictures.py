"""Pictures of docs/barba-langerman.md, drawn from the hierarchies and from a traced query.

    python docs/pictures/walk_pictures.py           # needs matplotlib; writes docs/pictures/walk_*.png
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

import collide
from collide.hull.exact_hull import convex_hull
from collide.papers.hierarchies.hierarchy_queries import walk_body

matplotlib.use("Agg")
from matplotlib import pyplot
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

FOLDER = Path(__file__).parent
BLUE, RED, GREY, GREEN = "#3b6ea5", "#c0504d", "#9a9a9a", "#4f8a4f"
LIGHT = np.array([0.4, -0.5, 0.77])


def ball(n: int, seed: int, stretch=(1.0, 1.0, 1.0)) -> np.ndarray:
    points = np.random.default_rng(seed).standard_normal((n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None] * stretch


def draw_body(axes, points, triangles, colour, alpha=1.0, edge=True):
    """Triangles, counter-clockwise from outside, shaded by where they face."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    shade = 0.75 + 0.35 * normals @ LIGHT
    base = np.array(matplotlib.colors.to_rgb(colour))
    faces = np.clip(base[None] * shade[:, None], 0, 1)
    axes.add_collection3d(
        Poly3DCollection(
            corners, facecolors=np.concatenate([faces, np.full((len(faces), 1), alpha)], axis=1),
            edgecolors=(0, 0, 0, 0.35) if edge else "none", linewidths=0.4,
        )
    )


def tidy(axes, points, title):
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, (high - low).max() / 2
    axes.set(
        xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half),
        zlim=(middle[2] - half, middle[2] + half),
    )
    axes.set_box_aspect((1, 1, 1), zoom=1.45)
    axes.set_axis_off()
    axes.set_title(title, fontsize=10)


def levels() -> None:
    """Six levels of a bounded hierarchy, the body itself first."""
    A = collide.ConvexHull(ball(400, 1))
    hierarchy = walk_body(A).hierarchy.hierarchy
    levels_drawn = np.unique(np.linspace(0, hierarchy.depth - 1, 6).astype(int))
    figure = pyplot.figure(figsize=(11, 2.2), layout="constrained")
    for k, level in enumerate(levels_drawn.tolist()):
        axes = figure.add_subplot(1, len(levels_drawn), k + 1, projection="3d")
        draw_body(axes, hierarchy.points, hierarchy.triangles(level), BLUE)
        count = len(hierarchy.vertices(level))
        tidy(axes, A.points, f"$P_{{{level + 1}}}$: {count} vertices")
    figure.savefig(FOLDER / "walk_levels.png", dpi=110)


def polar() -> None:
    """A body and its polar: a facet is a vertex there; a plane that parts P from R is a point of Q."""
    points = ball(24, 4, (1.0, 0.9, 0.8))
    R = collide.ConvexHull(points)
    side = walk_body(R).polar
    Q = side.hierarchy.hierarchy
    figure = pyplot.figure(figsize=(9, 4), layout="constrained")
    axes = figure.add_subplot(1, 2, 1, projection="3d")
    draw_body(axes, points, R.hull.facets, GREY, 0.9)
    triangles = side.triangles[side.starts[0] : side.starts[1]]
    draw_body(axes, points * 1.002, triangles, RED)
    tidy(axes, points, "R, and one of its facets")
    axes = figure.add_subplot(1, 2, 2, projection="3d")
    draw_body(axes, Q.points, Q.triangles(0), GREEN, 0.9)
    vertex = Q.points[0]
    axes.scatter(*(vertex * 1.01), color=RED, s=45, depthshade=False)
    direction = points[triangles].mean(axis=(0, 1))
    for each in figure.axes:
        azimuth = np.degrees(np.arctan2(direction[1], direction[0]))
        each.view_init(elev=15, azim=azimuth + 20)
    tidy(axes, Q.points[: len(side.starts) - 1], "Q = ρ₀(R), and the vertex that is this facet")
    figure.savefig(FOLDER / "walk_polar.png", dpi=110)


def query():
    """A pair whose walk goes to and fro; (A, B, X_WA, found)."""
    rng = np.random.default_rng(3)
    A, B = collide.ConvexHull(ball(400, 1)), collide.ConvexHull(ball(400, 2, (1.0, 0.9, 0.8)))
    best = None
    for _ in range(300):
        direction = rng.standard_normal(3)
        X = np.eye(4)
        X[:3, 3] = direction / np.linalg.norm(direction) * rng.uniform(1.7, 1.95)
        result = collide.walk(A, B, X, np.eye(4), trace=True)
        turns = sum(a.invariant != b.invariant for a, b in zip(result.trace, result.trace[1:]))
        if best is None or turns > best[0]:
            best = turns, X, result
    return A, B, best[1], best[2]


def rounds() -> None:
    """The rounds of one query: where it stands in both hierarchies, and how far its plane is from deciding."""
    A, B, X, result = query()
    primal, Q = A._walk.hierarchy.hierarchy, B._walk.polar.hierarchy.hierarchy
    offset = X[:3, 3] - B._walk.polar.origin
    figure, (path, margins) = pyplot.subplots(1, 2, figsize=(11, 4), layout="constrained")
    i, j = [r.level_p for r in result.trace], [r.level_q for r in result.trace]
    path.plot(i, j, color=GREY, zorder=1)
    for name, colour in (("separation", BLUE), ("inverse separation", GREEN)):
        steps_of = [r for r in result.trace if r.invariant == name]
        path.scatter([r.level_p for r in steps_of], [r.level_q for r in steps_of], color=colour, zorder=2, label=name)
    path.invert_xaxis()
    path.invert_yaxis()
    path.set(xlabel="level i of P", ylabel="level j of Q", title="one level down in each round")
    path.legend()
    numbers = np.arange(len(result.trace))
    now, whole = [], []
    for r in result.trace:
        if r.invariant == "separation":
            now.append(((primal.points[primal.vertices(r.level_p - 1)] + offset) @ r.z).min())
            whole.append(((primal.points[primal.vertices(0)] + offset) @ r.z).min())
        else:
            now.append((Q.points[Q.vertices(r.level_q - 1)] @ (r.x + offset)).max())
            whole.append((Q.points[Q.vertices(0)] @ (r.x + offset)).max())
    colours = [BLUE if r.invariant == "separation" else GREEN for r in result.trace]
    margins.axhline(1, color="black", linewidth=0.8)
    margins.vlines(numbers, whole, now, colors=colours, linewidth=1)
    margins.scatter(numbers, now, color=colours, label="against the level reached")
    margins.scatter(numbers, whole, color=colours, marker="x", label="against the body itself")
    margins.set(
        xlabel="round", ylabel="least ⟨p, z⟩ (blue), largest ⟨x, q⟩ (green)",
        title="blue stays above 1, green below, against the levels",
    )
    margins.legend()
    figure.savefig(FOLDER / "walk_rounds.png", dpi=110)


def bodies() -> None:
    """The same query in the primal space: the levels of P met, and the planes of the separation invariant."""
    A, B, X, result = query()
    primal = A._walk.hierarchy.hierarchy
    offset = X[:3, 3] - B._walk.polar.origin
    steps_of = [r for r in result.trace if r.invariant == "separation"]
    steps = [steps_of[k] for k in np.unique(np.linspace(0, len(steps_of) - 1, 3).astype(int))]
    figure = pyplot.figure(figsize=(11, 3.6), layout="constrained")
    body = B.points - B._walk.polar.origin
    for k, r in enumerate(steps):
        axes = figure.add_subplot(1, 3, k + 1, projection="3d")
        level = primal.triangles(r.level_p - 1)
        draw_body(axes, primal.points + offset, level, BLUE, 0.9)
        draw_body(axes, body, convex_hull(body).facets, GREY, 0.9, edge=False)
        normal = r.z / np.linalg.norm(r.z)
        centre = normal / np.linalg.norm(r.z)
        tangent = np.cross(normal, (0, 0, 1) if abs(normal[2]) < 0.9 else (1, 0, 0))
        tangent /= np.linalg.norm(tangent)
        bitangent = np.cross(normal, tangent)
        square = [centre + 1.3 * (a * tangent + b * bitangent) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        axes.add_collection3d(Poly3DCollection([square], facecolors=(*matplotlib.colors.to_rgb(RED), 0.25)))
        axes.scatter(*(primal.points[r.vertex_p] + offset), color=RED, s=25, depthshade=False)
        azimuth = np.degrees(np.arctan2(tangent[1], tangent[0]))
        axes.view_init(elev=8, azim=azimuth)
        tidy(
            axes,
            np.concatenate([body, primal.points[: len(A.points)] + offset]),
            f"$P_{{{r.level_p}}}$ beyond ρ(z), j = {r.level_q}",
        )
    figure.savefig(FOLDER / "walk_planes.png", dpi=110)


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for draw in (levels, polar, rounds, bodies):
        draw()
        print(draw.__name__)


if __name__ == "__main__":
    main()
