"""Scenes made by rule from a seed: the same name, seed and sizes give the same numbers.

    generate("workcell", seed=0, parts=16)       an arm of our own making over a bench of parts
    generate("clutter", seed=0, n=100, density=0.2)   convex shapes of every kind, anywhere
    generate("stack", seed=0, layers=6, wide=4)   boxes resting on each other
    generate("harpsicordia", n=1000, stretch=10.0, spread=None, gap=0.0)   two local meshes, n log n meetings
    generate("accordions", strings=40, gap=0.0)   two meshes whose n strings all meet
    generate("chazelle", strings=40, gap=0.0)     the same with Chazelle's polyhedra

Random numbers come from ``numpy.random.default_rng(seed)`` alone.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import SceneError, brief
from collide.scenes.description import Scene, SceneBody
from collide.scenes.loaders import scene_yaml
from collide.scenes.loaders.fields import did_you_mean
from collide.scenes.worst_cases import accordion, below, chazelle, count_of, harpsicordia
from collide.shapes import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, HPolytope, Mesh, Shape, Sphere
from collide.transforms import pose


def generate(name: str, seed: int = 0, **size) -> Scene:
    """A generated scene: the same name, seed and size give the same scene.

    Parameters
    ----------
    name : str
        One of `names`.
    seed : int
        ≥ 0.
    **size
        The generator's own arguments, for example ``n`` of "stack".

    Returns
    -------
    Scene
        Its ``sources`` say how it was made.

    Raises
    ------
    SceneError
        For an unknown name, seed or argument, listing the known ones.
    """
    if checks.text("generate: name", name, SceneError) not in _GENERATORS:
        raise SceneError(
            f"no generated scene has the name {brief(name)}{did_you_mean(name, _GENERATORS)}; "
            f"there are {', '.join(names())}"
        )
    if not checks.is_integer(seed) or not 0 <= seed < 2**64:
        raise SceneError(f"seed must be a whole number ≥ 0 of at most 64 bits, got {brief(seed)}")
    make = _GENERATORS[name]
    known = [argument for argument in inspect.signature(make).parameters if argument != "rng"]
    for argument in size:
        if argument not in known:
            raise SceneError(
                f"{name} has no argument {argument!r}{did_you_mean(argument, known)}; it has {', '.join(known)}"
            )
    scene = make(np.random.default_rng(seed), **size)
    arguments = [repr(name), f"seed={seed}", *(f"{k}={v!r}" for k, v in size.items())]
    scene.sources = [f"generate({', '.join(arguments)})"]
    return scene


def names() -> list[str]:
    """The generated scenes there are."""
    return sorted(_GENERATORS)


# --- clutter ------------------------------------------------------------------------------------


def _clutter(rng: np.random.Generator, n: int = 100, density: float = 0.2, static: float = 0.0) -> Scene:
    """n convex shapes of every bounded kind, anywhere in a cube, turned any way.

    density : volume of the shapes' bounding balls over that of the cube; 0.2 leaves most apart.
    static : share of the bodies that stand still.
    """
    n = count_of("n", n)
    share = checks.number_within("density", density, 1e-9, 100, SceneError)
    static = checks.number_within("static", static, 0, 1, SceneError)
    reaches = 0.05 * np.exp(0.4 * rng.standard_normal(n))
    edge = float((4 / 3 * math.pi * (reaches**3).sum() / share) ** (1 / 3))
    scene = Scene("clutter")
    for k, reach in enumerate(reaches):
        kind = list(_RANDOM_SHAPES)[int(rng.integers(len(_RANDOM_SHAPES)))]
        X = pose(rng.uniform(-edge / 2, edge / 2, 3), quat_wxyz=rng.standard_normal(4))
        still = bool(rng.random() < static)
        scene.add(
            SceneBody(f"{kind}_{k}", _RANDOM_SHAPES[kind](rng, float(reach)), X, static=still, source=f"clutter: {k}")
        )
    return scene


def _random_hull(rng: np.random.Generator, reach: float) -> Shape:
    points = rng.standard_normal((int(rng.integers(4, 33)), 3))
    return ConvexHull(points * (reach / np.linalg.norm(points, axis=1).max()))


def _random_hpolytope(rng: np.random.Generator, reach: float) -> Shape:
    """A cube cut by a few planes; the numbers are short, since its vertices are found exactly."""
    cuts = np.round(rng.uniform(-1, 1, (4, 3)), 2)
    cuts = cuts[np.abs(cuts).sum(axis=1) > 0.2]
    normals = np.concatenate([np.eye(3), -np.eye(3), cuts])
    offsets = np.concatenate([np.full(6, 0.57), np.full(len(cuts), 0.4)]) * reach
    return HPolytope(normals, np.round(offsets, 4))


def _ratio(rng: np.random.Generator) -> float:
    return float(rng.uniform(0.3, 0.9))


#: kind -> (rng, reach) -> a shape that fits a ball of that radius
_RANDOM_SHAPES: dict[str, Callable[[np.random.Generator, float], Shape]] = {
    "sphere": lambda rng, reach: Sphere(reach),
    "box": lambda rng, reach: Box(rng.uniform(0.3, 1.1, 3) * reach),
    "capsule": lambda rng, reach: Capsule(reach * (r := _ratio(rng)), 2 * reach * (1 - r)),
    "cylinder": lambda rng, reach: Cylinder(reach * (r := _ratio(rng)), 2 * reach * math.sqrt(1 - r * r)),
    "cone": lambda rng, reach: Cone(reach * (r := _ratio(rng)), 2 * reach * math.sqrt(1 - r * r)),
    "ellipsoid": lambda rng, reach: Ellipsoid(rng.uniform(0.2, 1.0, 3) * reach),
    "hull": _random_hull,
    "hpolytope": _random_hpolytope,
}


# --- stack --------------------------------------------------------------------------------------


def _stack(rng: np.random.Generator, layers: int = 6, wide: int = 4, jitter: float = 0.01) -> Scene:
    """A wall of boxes, each layer resting exactly on the one below.

    Heights are multiples of 1/8 m, which float64 holds exactly, and boxes are turned about the
    vertical alone: bodies on top of each other touch within rounding, those beside each other are
    25 mm apart on average. jitter : largest shift along the wall [m] and turn [rad].
    """
    layers, wide = count_of("layers", layers), count_of("wide", wide)
    jitter = checks.number_within("jitter", jitter, 0, 1, SceneError)
    size, pitch = np.array([0.25, 0.125, 0.125]), 0.275
    scene = Scene("stack")
    scene.add(
        SceneBody(
            "ground", Box((pitch * (wide + 2), 1.0, 0.25)), pose((0, 0, -0.125)), static=True, source="stack: ground"
        )
    )
    for layer in range(layers):
        for k in range(wide):
            shift, angle = rng.uniform(-jitter, jitter, 2)
            x = (k - (wide - 1) / 2 + (0.25 if layer % 2 else -0.25)) * pitch + shift
            X = pose((x, 0.0, (layer + 0.5) * size[2]), rpy=(0.0, 0.0, angle))
            scene.add(SceneBody(f"box_{layer}_{k}", Box(size), X, source=f"stack: layer {layer}, box {k}"))
    return scene


# --- work cell ----------------------------------------------------------------------------------


def _workcell(rng: np.random.Generator, parts: int = 16) -> Scene:
    """An arm of seven joints and a gripper over a bench with a fixture and scattered parts."""
    return scene_yaml.build(workcell_document(rng, count_of("parts", parts, 0)), "workcell")


def workcell_document(rng: np.random.Generator, parts: int = 16) -> dict[str, Any]:
    """The work cell as a scene document (docs/scene-format.md); the shipped one is seed 0.

    All numbers are short decimals, so that a file of them says exactly the same.
    """
    half = round(max(0.8, 0.16 * math.sqrt(parts)), 2)
    bodies: list[dict[str, Any]] = [
        _item("floor", {"halfspace": {"normal": [0, 0, 1], "offset": -0.8}}, static=True),
        _item("bench", {"box": {"size": [2 * half, 2 * half, 0.05]}}, [0, 0, -0.025], static=True),
        _item("fence", {"box": {"size": [2 * half, 0.02, 0.9]}}, [0, -0.34, 0.45], static=True),
        _item("post", {"box": {"size": [0.05, 0.05, 0.26]}}, [0.539, 0.142, 0.13], static=True),
        _item(
            "hook", {"capsule": {"radius": 0.01, "length": 0.3}}, [0.17, 0.10, 0.68], rpy_deg=[0, 90, 17], static=True
        ),
    ]
    taken = [(0.0, 0.0, 0.2), (0.54, 0.14, 0.06)]
    for k in range(parts):
        kind = list(_PARTS)[k % len(_PARTS)]
        shape, height, reach = _PARTS[kind](rng)
        x, y = _free_place(rng, reach, taken, half)
        taken.append((x, y, reach))
        yaw = int(rng.integers(0, 360))
        rpy = [0, 90, yaw] if kind == "capsule" else [0, 0, yaw]
        bodies.append(_item(f"{kind}_{k + 1:02d}", shape, [x, y, height], rpy_deg=rpy))
    return {"collide": 1, "name": "workcell", "robots": [{"robot": _arm(), "state": "reach"}], "bodies": bodies}


def _item(name: str, shape: dict, xyz=None, *, rpy_deg=None, static: bool = False) -> dict[str, Any]:
    item: dict[str, Any] = {"name": name, "shape": shape}
    if xyz is not None:
        item["pose"] = {"xyz": [round(float(v), 6) for v in xyz], **({"rpy_deg": rpy_deg} if rpy_deg else {})}
    if static:
        item["static"] = True
    return item


def _free_place(rng: np.random.Generator, reach: float, taken: list, half: float) -> tuple[float, float]:
    """A place on the bench 15 mm from everything taken, in front of the fence."""
    while True:
        x, y = (round(float(v), 3) for v in (rng.uniform(-half + 0.1, half - 0.1), rng.uniform(-0.24, half - 0.1)))
        if all(math.hypot(x - a, y - b) > reach + r + 0.015 for a, b, r in taken):
            return x, y


def _mm(rng: np.random.Generator, low: float, high: float) -> float:
    """A length of a whole number of millimetres [m]."""
    return round(float(rng.uniform(low, high)), 3)


def _part_box(rng):
    x, y, z = _mm(rng, 0.04, 0.12), _mm(rng, 0.04, 0.12), _mm(rng, 0.03, 0.12)
    return {"box": {"size": [x, y, z]}}, z / 2, math.hypot(x, y) / 2


def _part_round(kind: str):
    def part(rng):
        radius, length = _mm(rng, 0.02, 0.05), _mm(rng, 0.04, 0.14)
        return {kind: {"radius": radius, "length": length}}, length / 2, radius

    return part


def _part_sphere(rng):
    radius = _mm(rng, 0.02, 0.05)
    return {"sphere": {"radius": radius}}, radius, radius


def _part_capsule(rng):
    radius, length = _mm(rng, 0.01, 0.025), _mm(rng, 0.05, 0.12)
    return {"capsule": {"radius": radius, "length": length}}, radius, radius + length / 2


def _part_ellipsoid(rng):
    radii = [_mm(rng, 0.02, 0.06) for _ in range(3)]
    return {"ellipsoid": {"radii": radii}}, radii[2], max(radii[:2])


def _part_hull(rng):
    """A wedge: a rectangle on the bench, a ridge above it."""
    x, y, z = _mm(rng, 0.03, 0.06), _mm(rng, 0.03, 0.05), _mm(rng, 0.03, 0.10)
    top = round(x / 3, 3)
    points = [[sx * x, sy * y, 0] for sx in (-1, 1) for sy in (-1, 1)] + [[-top, 0, z], [top, 0, z]]
    return {"hull": {"points": points}}, 0.0, math.hypot(x, y)


def _part_hpolytope(rng):
    """A block with one edge cut off."""
    x, y, z = _mm(rng, 0.03, 0.06), _mm(rng, 0.03, 0.06), _mm(rng, 0.04, 0.08)
    normals = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 0, 1]]
    return (
        {"hpolytope": {"normals": normals, "offsets": [x, x, y, y, z, 0, round(x + z - 0.02, 3)]}},
        0.0,
        math.hypot(x, y),
    )


#: kind -> rng -> (shape, height of its frame above the bench, radius of its footprint)
_PARTS: dict[str, Callable] = {
    "box": _part_box,
    "cylinder": _part_round("cylinder"),
    "cone": _part_round("cone"),
    "sphere": _part_sphere,
    "capsule": _part_capsule,
    "ellipsoid": _part_ellipsoid,
    "wedge": _part_hull,
    "block": _part_hpolytope,
}


def _arm() -> dict[str, Any]:
    """A six-axis arm with a gripper of two fingers, the second following the first."""
    def link(name: str, shape: dict, xyz) -> dict[str, Any]:
        return {"name": name, "collision": [{"shape": shape, "pose": {"xyz": xyz}}]}

    def revolute(name: str, parent: str, child: str, xyz, axis, limit: float) -> dict[str, Any]:
        return {
            "name": name, "type": "revolute", "parent": parent, "child": child, "origin": {"xyz": xyz}, "axis": axis,
            "limits": [-limit, limit],
        }

    ring = [(1, 0), (0.7, 0.7), (0, 1), (-0.7, 0.7), (-1, 0), (-0.7, -0.7), (0, -1), (0.7, -0.7)]
    roll = [[round(r * x, 4), round(r * y, 4), z] for r, z in ((0.045, 0.0), (0.035, 0.09)) for x, y in ring]
    palm = [
        [sx * w, sy * d, z] for w, d, z in ((0.02, 0.04, 0.0), (0.025, 0.065, 0.05)) for sx in (-1, 1) for sy in (-1, 1)
    ]
    finger = {"box": {"size": [0.02, 0.015, 0.07]}}
    slide = {"type": "prismatic", "parent": "palm", "origin": {"xyz": [0, 0, 0.05]}, "limits": [0.0, 0.05]}
    return {
        "name": "arm",
        "links": [
            link("base", {"box": {"size": [0.2, 0.2, 0.12]}}, [0, 0, 0.06]),
            link("turret", {"capsule": {"radius": 0.07, "length": 0.1}}, [0, 0, 0.09]),
            link("upper_arm", {"capsule": {"radius": 0.055, "length": 0.36}}, [0, 0, 0.18]),
            link("forearm", {"capsule": {"radius": 0.045, "length": 0.3}}, [0, 0, 0.15]),
            link("roll", {"hull": {"points": roll}}, [0, 0, 0]),
            link("wrist", {"capsule": {"radius": 0.035, "length": 0.04}}, [0, 0, 0.03]),
            link("palm", {"hull": {"points": palm}}, [0, 0, 0]),
            link("left_finger", finger, [0, 0.0075, 0.035]),
            link("right_finger", finger, [0, -0.0075, 0.035]),
        ],
        "joints": [
            revolute("yaw", "base", "turret", [0, 0, 0.12], [0, 0, 1], 3.0),
            revolute("shoulder", "turret", "upper_arm", [0, 0, 0.16], [0, 1, 0], 2.0),
            revolute("elbow", "upper_arm", "forearm", [0, 0, 0.36], [0, 1, 0], 2.6),
            revolute("forearm_roll", "forearm", "roll", [0, 0, 0.3], [0, 0, 1], 3.0),
            revolute("wrist_pitch", "roll", "wrist", [0, 0, 0.1], [0, 1, 0], 2.2),
            revolute("wrist_roll", "wrist", "palm", [0, 0, 0.09], [0, 0, 1], 3.0),
            {"name": "left_slide", **slide, "child": "left_finger", "axis": [0, 1, 0]},
            {
                "name": "right_slide",
                **slide,
                "child": "right_finger",
                "axis": [0, -1, 0],
                "mimic": {"joint": "left_slide"},
            },
        ],
        "allow": [
            *(
                [a, b, "adjacent links"]
                for a, b in (
                    ("base", "turret"),
                    ("turret", "upper_arm"),
                    ("upper_arm", "forearm"),
                    ("forearm", "roll"),
                    ("roll", "wrist"),
                    ("wrist", "palm"),
                    ("palm", "left_finger"),
                    ("palm", "right_finger"),
                )
            ),
            ["forearm", "wrist", "always close"],
            ["roll", "palm", "always close"],
            ["left_finger", "right_finger", "close on each other"],
        ],
        "states": {
            "home": dict.fromkeys(
                ("yaw", "shoulder", "elbow", "forearm_roll", "wrist_pitch", "wrist_roll", "left_slide"), 0.0
            ),
            "reach": {
                "yaw": 0.3,
                "shoulder": 0.5,
                "elbow": 1.4,
                "forearm_roll": 0.0,
                "wrist_pitch": 1.2416,
                "wrist_roll": 0.0,
                "left_slide": 0.02,
            },
        },
    }


# --- worst cases of meshes ------------------------------------------------------------------------


def _harpsicordia(
    rng: np.random.Generator, n: int = 1000, stretch: float = 10.0, spread: float | None = None, gap: float = 0.0
) -> Scene:
    """Two local meshes of about n vertices that meet in Θ(n log n) points (`collide.scenes.worst_cases`).

    stretch : local stretch σ ≥ 6.   spread : global stretch Σ at most; n where None.   gap : the upper one is
    lifted by it [m]; 0 touches, less than 0 crosses.
    """
    upper, lower, meetings = harpsicordia(n, stretch, spread)
    return _across_the_saddle(rng, "harpsicordia", upper, lower, meetings, gap)


def _accordions(rng: np.random.Generator, strings: int = 40, gap: float = 0.0) -> Scene:
    """Two accordions each of whose strings meets every one of the other. gap : as above [m]."""
    mesh = accordion(strings)
    return _across_the_saddle(rng, "accordions", mesh, below(mesh), strings**2, gap)


def _chazelle(rng: np.random.Generator, strings: int = 40, gap: float = 0.0) -> Scene:
    """Two of Chazelle's polyhedra each of whose ridges meets every one of the other. gap : as above [m]."""
    mesh = chazelle(strings)
    return _across_the_saddle(rng, "chazelle", mesh, below(mesh), strings**2, gap)


def _across_the_saddle(rng, name: str, upper: Mesh, lower: Mesh, meetings: int, gap) -> Scene:
    """Two bodies, vertices and facets in random order: nothing should depend on how a file lists them."""
    gap = checks.number_within("gap", gap, -1, 1, SceneError)
    scene = Scene(name)
    for label, mesh, lift in (("upper", upper, gap), ("lower", lower, 0.0)):
        scene.add(SceneBody(label, _shuffled(rng, mesh), pose((0.0, 0.0, lift)), source=f"{name}: {label}"))
    scene.notes.append(f"{name}: the surfaces are {gap:g} m apart at {meetings} places")
    return scene


def _shuffled(rng: np.random.Generator, mesh: Mesh) -> Mesh:
    order = rng.permutation(len(mesh.vertices))
    place = np.argsort(order)
    return Mesh(mesh.vertices[order], place[mesh.faces[rng.permutation(len(mesh.faces))]], solid=True)


_GENERATORS: dict[str, Callable[..., Scene]] = {
    "clutter": _clutter, "stack": _stack, "workcell": _workcell,
    "harpsicordia": _harpsicordia, "accordions": _accordions, "chazelle": _chazelle,
}
