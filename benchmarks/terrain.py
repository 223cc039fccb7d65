"""What terrain costs, to make and to ask about bodies that rest on it, beside MuJoCo's height fields.

    python benchmarks/terrain.py --table made asked apart

made    a HeightField of n² heights and its first contact; MuJoCo compiles a model, is given the heights, and collides
asked   bodies at rest, 5 mm deep: booleans and contacts, ours in batches, `mj_collision` in a loop of Python with the
        kinematics of the body; the least distance of bodies a hand above, ours alone
apart   how the deepest contacts differ, and what `mj_geomDistance` says of bodies above: it takes height fields and
        answers, but the numbers are no distances from the terrain

Hills of a metre over cells of 10 cm, with noise of 2 cm; both engines cut a cell along the same diagonal. MuJoCo keeps
heights as floats: ours are given the same floats. Without mujoco its columns are left out.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from functools import cache, partial
from typing import Any

import numpy as np

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main

_EYE = np.eye(4)
_CELL, _BASE = 0.1, 1.0
#: Shapes, and the same as MuJoCo's geoms.
BODIES = {
    "box": (collide.Box((0.2, 0.24, 0.3)), 'type="box" size="0.1 0.12 0.15"'),
    "sphere": (collide.Sphere(0.1), 'type="sphere" size="0.1"'),
    "capsule": (collide.Capsule(0.1, 0.3), 'type="capsule" size="0.1 0.15"'),
}
_DEEP, _ABOVE = 0.005, 0.1


@cache
def heights(n: int) -> np.ndarray:
    """(n, n) float32 [m], from 0 on."""
    x = _CELL * np.arange(n)
    hills = 0.5 * np.sin(0.7 * x)[:, None] * np.cos(0.9 * x) + 0.02 * np.random.default_rng(n).random((n, n))
    return (hills - hills.min()).astype(np.float32)


@cache
def terrain(n: int) -> collide.HeightField:
    return collide.HeightField(heights(n), _CELL, bottom=-_BASE)


class MujocoTerrain:
    """The same terrain and a free body as a model."""

    def __init__(self, n: int, body: str):
        import mujoco

        half, top = 0.5 * _CELL * (n - 1), float(heights(n).max())
        self.mujoco = mujoco
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><asset><hfield name="t" nrow="{n}" ncol="{n}" size="{half} {half} {top!r} {_BASE}"/></asset>'
            f'<worldbody><geom type="hfield" hfield="t"/><body><freejoint/><geom {BODIES[body][1]}/></body></worldbody>'
            "</mujoco>"
        )
        self.model.hfield_data[:] = heights(n).ravel() / np.float32(top)
        self.data = mujoco.MjData(self.model)

    def collided(self, q: np.ndarray) -> Any:
        """The contacts of the body at a place and quaternion (7,)."""
        self.data.qpos[:] = q
        self.mujoco.mj_kinematics(self.model, self.data)
        self.mujoco.mj_collision(self.model, self.data)
        return self.data.contact

    def all_collided(self, Q: np.ndarray) -> None:
        for q in Q:
            self.collided(q)

    def distance(self, q: np.ndarray) -> float:
        """What `mj_geomDistance` says [m]."""
        self.collided(q)
        return self.mujoco.mj_geomDistance(self.model, self.data, 0, 1, 1e3, None)


@cache
def at_rest(n: int, body: str, asks: int) -> tuple[np.ndarray, np.ndarray]:
    """(poses (k, 4, 4) of a body some millimetres in the terrain, the same as places and quaternions (k, 7))."""
    rng, half = np.random.default_rng(5), 0.4 * _CELL * (n - 1)
    yaw, above = rng.uniform(-np.pi, np.pi, asks), float(heights(n).max()) + 1.0
    p = np.column_stack([rng.uniform(-half, half, (asks, 2)), np.full(asks, above)])
    start = collide.poses(p, rpy=np.column_stack([np.zeros((asks, 2)), yaw]))
    down = collide.shape_cast(BODIES[body][0], start, (0, 0, -1.0), terrain(n), _EYE).distance
    start[:, 2, 3] -= down + _DEEP
    turns = np.column_stack([np.cos(0.5 * yaw), np.zeros((asks, 2)), np.sin(0.5 * yaw)])
    return start, np.column_stack([start[:, :3, 3], turns])


def made(options: Options, n: int) -> Race:
    X, Q = at_rest(n, "box", 2)
    shape, numbers = BODIES["box"][0], heights(n)

    def ours() -> None:
        collide.contacts(collide.HeightField(numbers, _CELL, bottom=-_BASE), shape, _EYE, X[0])

    collide.contacts(terrain(100), shape, _EYE, X[0])  # what is loaded once is not the terrain's
    tracemalloc.start()
    field = collide.HeightField(numbers, _CELL, bottom=-_BASE)
    collide.contacts(field, shape, _EYE, X[0])
    n_bytes = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    tasks, beside = {"collide": ours}, {"collide": {"bytes_a_cell": n_bytes / (n - 1) ** 2}}
    if installed(mujoco="mujoco"):
        tasks["mujoco"] = lambda: MujocoTerrain(n, "box").collided(Q[0])
        beside["mujoco"] = {"bytes_a_cell": MujocoTerrain(n, "box").model.nbuffer / (n - 1) ** 2}
    return Race(tasks, beside=beside)


def asked(options: Options, n: int, body: str, question: str) -> Race:
    asks = 50 if options.quick else 500
    X, Q = at_rest(n, body, asks)
    shape, field = BODIES[body][0], terrain(n)
    if question == "distance":
        raised = X.copy()
        raised[:, 2, 3] += _DEEP + _ABOVE
        return Race({"collide": partial(collide.distance, field, shape, _EYE, raised)}, per=asks)
    ours = collide.collide if question == "boolean" else collide.contacts
    tasks = {"collide": partial(ours, field, shape, _EYE, X)}
    if installed(mujoco="mujoco"):
        tasks["mujoco"] = partial(MujocoTerrain(n, body).all_collided, Q)
    for task in tasks.values():
        task()
    return Race(tasks, per=asks)


def apart(options: Options, n: int, body: str) -> Iterator[dict]:
    """The deepest contacts of bodies at rest, and distances of bodies above, of both engines."""
    if not installed(mujoco="mujoco"):
        return
    asks = 50 if options.quick else 500
    X, Q = at_rest(n, body, asks)
    shape, field, theirs = BODIES[body][0], terrain(n), MujocoTerrain(n, body)
    depths = np.array([min((c.dist for c in theirs.collided(q)), default=np.nan) for q in Q])
    ours = np.array([collide.contacts(field, shape, _EYE, x).rows["distance"].min(initial=0.0) for x in X])
    raised = X.copy()
    raised[:, 2, 3] += _DEEP + _ABOVE
    gaps = collide.distance(field, shape, _EYE, raised).distance
    lifted = Q + np.array([0, 0, _DEEP + _ABOVE, 0, 0, 0, 0])
    off = np.array([theirs.distance(q) for q in lifted]) - gaps
    differs = np.abs(depths - ours)
    yield {
        "poses": asks, "both_touch": int(np.count_nonzero(~np.isnan(depths) & (ours < 0.0))),
        "depth_median_off_mm": 1e3 * float(np.nanmedian(differs)), "depth_most_off_mm": 1e3 * float(np.nanmax(differs)),
        "distance_least_off_m": float(off.min()), "distance_most_off_m": float(off.max()),
    }


def sizes(options: Options) -> tuple[int, ...]:
    return (100,) if options.quick else (100, 1000, 3000)


CLAIMS = [
    Claim("made", "ms to make terrain and find a first contact", lambda o: grid(n=sizes(o)), made, unit="ms",
          file="terrain-made", turns=5),
    Claim("asked", "µs a body on terrain",
          lambda o: grid(n=sizes(o), body=BODIES, question=("boolean", "contacts", "distance")), asked,
          file="terrain-asked", turns=5),
    Claim("apart", "how depths and distances of both engines differ", lambda o: grid(n=sizes(o)[:2], body=BODIES),
          apart, file="terrain-apart"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
