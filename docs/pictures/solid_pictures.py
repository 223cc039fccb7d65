"""The picture of a clash in docs/solids.md: two solids, what they have in common, and one without the other.

    python docs/pictures/solid_pictures.py
    # needs matplotlib; --out FOLDER, docs/pictures by default
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "families"))
from mesh_shapes import bumpy_sphere

import collide

COLOURS = np.array([[0.16, 0.44, 0.71], [0.93, 0.55, 0.14]])
ELEVATION, AZIMUTH = 22.0, -62.0
_E, _A = np.radians([ELEVATION, AZIMUTH])
TO_EYE = np.array([np.cos(_E) * np.cos(_A), np.cos(_E) * np.sin(_A), np.sin(_E)])
CLASH = np.array([0.80, 0.15, 0.20])


def draw(axes, corners: np.ndarray, colours: np.ndarray, alpha: float = 1.0) -> None:
    """Triangles (k, 3, 3) that face the eye, lit, in colours (k, 3)."""
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.sqrt(np.square(n).sum(axis=1))[:, None] + 1e-300
    facing = n @ TO_EYE > 0.0
    corners, colours, n = corners[facing], colours[facing], n[facing]
    light = 0.45 + 0.55 * np.clip(n @ np.array([0.3, -0.6, 0.74]), 0.0, 1.0)
    faces = np.column_stack([colours * light[:, None], np.full(len(corners), alpha)])
    edges = (0, 0, 0, 0.12 * alpha)
    axes.add_collection3d(Poly3DCollection(corners, facecolors=faces, edgecolors=edges, linewidths=0.2))


def frame(axes, title: str, corners: np.ndarray) -> None:
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    middle, reach = (low + high) / 2, 0.33 * (high - low).max()
    axes.set(xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach),
             zlim=(middle[2] - reach, middle[2] + reach))
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=ELEVATION, azim=AZIMUTH)
    axes.set_proj_type("ortho")
    axes.set_axis_off()
    axes.set_title(title, fontsize=9, y=-0.06)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures")
    folder = parser.parse_args().out
    A = collide.Mesh(*bumpy_sphere(2000, 0), solid=True)
    B = collide.Box((0.7, 0.7, 3.2))
    X, Y = np.eye(4), collide.pose((0.45, -0.35, 0.0), rpy=(0.35, 0.25, 0.4))
    results = {op: collide.boolean(A, B, X, Y, op) for op in ("union", "intersection", "difference")}
    corners = {op: r.mesh.vertices[r.mesh.faces] for op, r in results.items()}
    overlap = collide.overlap_volume(A, B, X, Y)
    print(f"volume {overlap.volume!r} in {overlap.lower!r} … {overlap.upper!r}, cut {overlap.n_cut}, moved "
          f"{max(r.moved for r in results.values()):.1e} m")
    figure = plt.figure(figsize=(9.6, 3.2))
    titles = "A and B, their clash in red", "A ∩ B", "A without B"
    for k, (op, title) in enumerate(zip(("union", "intersection", "difference"), titles)):
        axes = figure.add_subplot(1, 3, k + 1, projection="3d", computed_zorder=False)
        colours = COLOURS[results[op].body]
        if op == "union":
            draw(axes, corners["intersection"], np.tile(CLASH, (len(corners["intersection"]), 1)))
            draw(axes, corners[op], colours, 0.28)
        else:
            draw(axes, corners[op], colours)
        frame(axes, title, corners["union"])
    figure.subplots_adjust(0, 0.03, 1, 1, 0, 0)
    figure.savefig(folder / "solids-clash.png", dpi=130)


if __name__ == "__main__":
    main()
