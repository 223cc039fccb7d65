"""The picture of docs/locality.md: a box and a part, before and after they were made local, facets that face the eye.

    python docs/pictures/localised_picture.py       # needs matplotlib and pybullet_data; writes localised.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pybullet_data
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "families"))
import surfaces

from collide import Mesh
from collide.scenes.loaders.triangles import read_meshes


def main() -> None:
    surface = read_meshes(next(Path(pybullet_data.getDataPath()).rglob("fr12_h103_lowres.stl")))[0][1]
    figure = Figure(figsize=(11, 7), layout="constrained")
    axes = figure.subplots(2, 2, subplot_kw={"projection": "3d"})
    elevation, azimuth = np.radians(50.0), np.radians(35.0)
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    bodies = (("64 × 64 × 1 box", Mesh(*surfaces.box((0, 0, 0), (64.0, 64.0, 1.0)))),
              ("fr12_h103_lowres.stl", Mesh(surface.vertices, surface.faces)))
    for panels, (name, body) in zip(axes, bodies):
        made = body.localised()
        for panel, mesh, locality in zip(panels, (body, made.mesh), (made.before, made.after)):
            corners = mesh.vertices[mesh.faces]
            low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
            faces_eye = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ towards > 0.0
            panel.add_collection3d(
                Poly3DCollection(corners[faces_eye], facecolors="#dbe8f5", edgecolors="#16324f", linewidths=0.35)
            )
            panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
            panel.set_box_aspect(high - low, zoom=0.95)
            panel.set_axis_off()
            panel.view_init(np.degrees(elevation), np.degrees(azimuth))
            panel.set_title(f"{name}: {len(mesh.faces)} facets, σ = {locality.local_stretches[0]:.1f}", fontsize=10)
    figure.savefig(Path(__file__).parent / "localised.png", dpi=110)


if __name__ == "__main__":
    main()
