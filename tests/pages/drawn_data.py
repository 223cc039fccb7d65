"""Data of pages made by hand, as the contract of the page has them: shapes, bodies, reports, states."""

from __future__ import annotations

import base64

import numpy as np

CLASSES = ("colliding", "shallow", "touching", "near")
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
_SIDES = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
    [1, 5, 7], [1, 7, 3],
])


def packed(values: np.ndarray, dtype: str) -> str:
    return base64.b64encode(np.asarray(values, dtype).tobytes()).decode()


def shape_of(positions, triangles, smooth: bool = False) -> dict:
    """A shape of a drawing."""
    return {
        "positions": packed(positions, "<f4"), "triangles": packed(triangles, "<u4"), "vertex_count": len(positions),
        "triangle_count": len(triangles), "smooth": smooth, "simplified_from": None, "deviation": None,
        "unbounded": False,
    }


def box(half: float) -> dict:
    return shape_of(half * _CORNERS, _SIDES)


def grid_shape(n: int, seed: int) -> dict:
    """A wavy square of 2·n² facets, another one for each seed."""
    u = np.linspace(-0.4, 0.4, n + 1)
    x, y = (c.ravel() for c in np.meshgrid(u, u, indexing="ij"))
    z = 0.1 * np.sin(5 * x + seed) * np.cos(4 * y - seed)
    i, j = (c.ravel() for c in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    a = i * (n + 1) + j
    triangles = np.concatenate([np.stack([a, a + n + 1, a + 1], 1), np.stack([a + 1, a + n + 1, a + n + 2], 1)])
    return shape_of(np.stack([x, y, z], 1), triangles, smooth=seed % 2 == 0)


def body(name: str, position, verdict: str, shown: int = 0, **fields) -> dict:
    X_WB = np.eye(4)
    X_WB[:3, 3] = position
    return {
        "name": name, "static": False, "owner": None, "kind": "Box", "X_WB": X_WB.ravel().tolist(), "shown": shown,
        "tested": None, "verdict": verdict, "note": None, **fields,
    }


def pair(a: str, b: str, distance: float, point_a=(0, 0, 0), normal=(1, 0, 0), how: str = "closed form") -> dict:
    n = np.array(normal, dtype=float)
    return {
        "a": a, "b": b, "distance": distance, "depth": -distance if distance < 0 else None,
        "lower": distance - 1e-15, "upper": distance + 1e-15, "normal": n.tolist(),
        "point_a": list(map(float, point_a)), "point_b": (np.array(point_a, dtype=float) + distance * n).tolist(),
        "part_a": 0, "part_b": 0, "how": how, "certified": True, "approximated": [],
    }


def report_of(name: str, clearance: float = 0.5, **classes) -> dict:
    """A report with pairs by class, and every other field filled."""
    pairs = {key: classes.get(key, []) for key in CLASSES}
    return {
        "schema": "collide-report/4",
        "verdict": {
            "text": f"verdict of {name}", "collides": bool(pairs["colliding"]), **{k: len(v) for k, v in pairs.items()},
        },
        "scene": {"name": name, "sources": [f"{name}.yaml"], "bodies": 3, "static": 1, "robots": ["arm"]},
        "query": {"clearance": clearance, "min_depth": 0.0, "ignored": [["ignored A", "ignored B"]]},
        "pairs": {"total": 10, "excluded": 4, "apart_by_boxes": 3, "tested": 3},
        **pairs,
        "meshes": [
            {"body": "mesh body", "solid": False, "facets": 8, "what": "surface of 8 facets", "source": "mesh.stl"},
        ],
        "approximations": [
            {"body": "guessed body", "what": "hull of a mesh", "shape": "ConvexHull", "source": "a.urdf"},
        ],
        "unanswered": [{"a": "odd A", "b": "odd B", "why": "two surfaces without an end"}],
        "skipped": [{"reason": "SRDF: Adjacent", "pairs": 4, "meaning": "links that a joint connects"}],
        "proofs": [{"how": "closed form", "pairs": 3, "sentence": "a formula for this pair of shapes"}],
        "work": {"convex_pairs": 17}, "notes": ["joint 4 is outside its limits"],
        "seconds": {"read": 0.25, "report": 0.5, "other": 0.25, "total": 1.0},
        "versions": {"collide": "0.0.1", "python": "3.11", "numpy": "2.0", "kernels": "library, v4", "machine": None},
        "extra": {"from a later version": 1},
    }


def drawing_of(shapes: list[dict], bodies: list[dict], states: dict | None = None, kind: str = "report") -> dict:
    return {
        "version": 1, "kind": kind, "size": 4.0, "notes": ["one mesh drawn with fewer facets"], "contacts": None,
        "shapes": shapes, "bodies": bodies, "states": states,
    }
