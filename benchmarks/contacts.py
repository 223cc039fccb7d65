"""Contact manifolds beside coal's, Bullet's and MuJoCo's: pairs, single calls, batches, meshes, a world at rest.

    python benchmarks/contacts.py                   # four minutes
    python benchmarks/contacts.py --table world
    python benchmarks/contacts.py --quick           # a minute; no file

pairs    µs a pair. Bodies rest on a box or a hull, sunk by 0.1 mm ("touching") or 1 mm above with a margin of 2 mm
         ("apart"), turned at random. Ours: one batch. coal: a loop of Python over what was made ready, without and with
         its contact patches. Bullet and MuJoCo: all pairs by one call, declared or far from each other: no Python
single   µs a call from Python of one pair: `contacts`, `coal.collide`, `getClosestPoints`, `mj_collision`
batches  µs a pair of ours in batches of 1 to 10,000 boxes on boxes, beside coal's loop
meshes   µs a pair: a box on a rough ground of 100,352 facets, and two bunnies (from ../shared/data) that overlap by a
         thousandth of their size. coal's contacts there are pairs of facets; MuJoCo has no meshes that are not convex
world    ms a step of 5,000 bodies at rest in ten pits (`contact_worlds.py`): move, then find all contacts

CPU time. Checked first, and told: how many contacts a pair everyone finds; whoever finds none at all of bodies that
touch is not quicker but wrong. Bars are medians that ours is to stay below.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np
from contact_peers import BulletContacts, CoalContacts, MujocoContacts
from contact_worlds import WORLDS, OurWorld, Pits
from inputs import mesh, meshes_here

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main

BARS = {
    ("pairs", "box on box", "touching"): 1.0, ("pairs", "hull 48 on hull 48", "touching"): 1.5,
    ("pairs", "box on box", "apart"): 0.3, ("pairs", "hull 48 on hull 48", "apart"): 0.3,
    ("single", "box on box", "touching"): 3.0, ("meshes", "box on ground", "touching"): 20.0,
    ("meshes", "bunny on bunny", "touching"): 1000.0, ("world", "5000 bodies", "contacts"): 20.0,
}
BOX = collide.Box((0.4, 0.3, 0.2))
#: Sunk so far, or above by so much, within the margin [m].
STATES = {"touching": (-1e-4, 0.0), "apart": (1e-3, 2e-3)}


def hull(seed: int) -> collide.ConvexHull:
    """48 points near a ball, its lowest and highest on faces across z."""
    points = np.random.default_rng(seed).normal(size=(48, 3))
    points *= 0.2 / np.linalg.norm(points, axis=1)[:, None]
    points[:, 2] = np.clip(points[:, 2], -0.15, 0.15)
    return collide.ConvexHull(points)


def cases() -> dict[str, tuple[collide.Shape, collide.Shape, float, bool]]:
    """Name to (A, B, height of B's origin over A's where they touch, whether B lies on its side)."""
    lower, upper = hull(1), hull(2)
    return {
        "box on box": (BOX, collide.Box((0.3, 0.3, 0.2)), 0.2, False),
        "hull 48 on hull 48": (lower, upper, 0.3, False), "hull 48 on box": (BOX, upper, 0.25, False),
        "sphere on box": (BOX, collide.Sphere(0.1), 0.2, False),
        "capsule on box": (BOX, collide.Capsule(0.1, 0.2), 0.2, True),
        "cylinder on box, standing": (BOX, collide.Cylinder(0.1, 0.2), 0.2, False),
        "cylinder on box, lying": (BOX, collide.Cylinder(0.1, 0.2), 0.2, True),
    }


def resting(n: int, height: float, lying: bool, seed: int) -> np.ndarray:
    """(n, 4, 4): turned about the vertical, aside by at most a centimetre, one body lying on its side."""
    rng = np.random.default_rng(seed)
    return np.array([
        collide.pose((*rng.uniform(-0.01, 0.01, 2), height), rpy=(0.5 * np.pi * lying, 0, rng.uniform(-np.pi, np.pi)))
        for _ in range(n)
    ])


def per_pair(manifolds) -> float:
    """Contacts a pair."""
    return round(sum(len(m.distance) for m in manifolds) / len(manifolds), 2)


def bars(*key: str) -> dict[str, float]:
    return {"collide": BARS[key]} if key in BARS else {}


def pairs(options: Options, case: str, state: str) -> Race:
    (A, B, height, lying), (gap, margin), n = cases()[case], STATES[state], 100 if options.quick else 400
    Ys = resting(n, height + gap, lying, seed=n)
    ours = partial(collide.contacts, A, B, np.eye(4), Ys, margin=margin)
    tasks, beside, lists = {"collide": ours}, {"collide": {"contacts": len(ours()) / n}}, ([A] * n, [B] * n)
    kinds = {"coal": CoalContacts, "coal + patch": partial(CoalContacts, patches=True), "bullet": BulletContacts,
             "mujoco": MujocoContacts}
    packages = {"coal": "coal", "coal + patch": "coal", "bullet": "pybullet", "mujoco": "mujoco"}
    for name in installed(**packages):
        peer = kinds[name](*lists, np.tile(np.eye(4), (n, 1, 1)), Ys, margin)
        beside[name], tasks[name] = {"contacts": per_pair(peer.manifolds())}, peer.detect
    return Race(tasks, n, beside=beside, bars=bars("pairs", case, state))


def single(options: Options, case: str, state: str) -> Race:
    (A, B, height, lying), (gap, margin) = cases()[case], STATES[state]
    X, Y = np.eye(4), resting(1, height + gap, lying, seed=3)[0]
    tasks: dict[str, Callable] = {"collide": partial(collide.contacts, A, B, X, Y, margin=margin)}
    kinds = {"coal": CoalContacts, "bullet": BulletContacts, "mujoco": MujocoContacts}
    for name in installed(coal="coal", bullet="pybullet", mujoco="mujoco"):
        peer = kinds[name]([A], [B], [X], [Y], margin)
        tasks[name] = peer.closest_points if name == "bullet" else peer.detect
    return Race(tasks, bars=bars("single", case, state))


def batches(options: Options, poses: int) -> Race:
    A, B, height, lying = cases()["box on box"]
    Ys = resting(poses, height + STATES["touching"][0], lying, seed=poses)
    tasks: dict[str, Callable] = {"collide": partial(collide.contacts, A, B, np.eye(4), Ys)}
    if installed(coal="coal"):
        lists = [A] * poses, [B] * poses, np.tile(np.eye(4), (poses, 1, 1)), Ys
        tasks["coal"] = CoalContacts(*lists, 0.0).detect
    return Race(tasks, poses)


def ground(cells: int = 224, size: float = 4.0) -> collide.Mesh:
    """A rough surface of 2 · cells² facets, in cells of about two centimetres, some millimetres high."""
    xs = np.linspace(-size / 2, size / 2, cells + 1)
    x, y = np.meshgrid(xs, xs)
    z = 0.02 * np.sin(3 * x) * np.cos(2 * y) + np.random.default_rng(0).uniform(-1e-3, 1e-3, x.shape)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up, both = corner + 1, corner + cells + 1, corner + cells + 2
    faces = np.concatenate([np.stack([corner, right, both], axis=1), np.stack([corner, both, up], axis=1)])
    return collide.Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, solid=False)


def sunk_poses(A, B, n: int, depth: float, seed: int, spread: float) -> np.ndarray:
    """(n, 4, 4): B over A, let down until they touch, and by so much more [m]."""
    rng = np.random.default_rng(seed)
    placed = []
    for _ in range(n):
        place, tilt = rng.uniform(-spread, spread, 2), rng.uniform(-0.02, 0.02, 2)
        Y = collide.pose((*place, 2.0), rpy=(*tilt, rng.uniform(-3, 3)))
        for _ in range(200):
            gap = collide.distance(A, B, np.eye(4), Y, signed=False).distance
            Y[2, 3] -= gap
            if gap < 1e-7:
                break
        Y[2, 3] -= depth
        placed.append(Y)
    return np.array(placed)


def meshes(options: Options, case: str) -> Race:
    n = 10 if options.quick else 40
    if case == "bunny on bunny":
        A = B = collide.Mesh(*mesh("bunny"), solid=False)
        Ys = sunk_poses(A, B, n, 1e-3, 1, 0.1)
    else:
        A, B = ground(), collide.Box((0.1, 0.08, 0.06))
        Ys = sunk_poses(A, B, n, 2e-4, 1, 1.5)
    ours = partial(collide.contacts, A, B, np.eye(4), Ys)
    tasks, beside = {"collide": ours}, {"collide": {"contacts": len(ours()) / n}}
    kinds = {"coal": partial(CoalContacts, max_contacts=1 << 20), "bullet": BulletContacts}
    peers = {"coal": "coal"} | ({} if case == "bunny on bunny" else {"bullet": "pybullet"})
    for name in installed(**peers):
        peer = kinds[name]([A] * n, [B] * n, np.tile(np.eye(4), (n, 1, 1)), Ys, 0.0)
        beside[name], tasks[name] = {"contacts": per_pair(peer.manifolds())}, peer.detect
    return Race(tasks, n, beside=beside, bars=bars("meshes", case, "touching"))


@cache
def worlds(bodies: int) -> dict:
    pits = Pits(bodies)
    made = {"collide": OurWorld(pits)}
    return made | {name: WORLDS[name](pits) for name in installed(coal="coal", pybullet="pybullet", mujoco="mujoco")}


def world(options: Options, bodies: int, task: str) -> Race:
    """Contacts are asked for after a move, which is timed with them."""
    made = worlds(bodies)
    for of in made.values():
        of.move()
        of.detect()
    beside = {name: dict(zip(("pairs", "contacts"), of.counts())) for name, of in made.items()}

    def step(of) -> None:
        of.move()
        of.detect()

    tasks = {name: of.move if task == "move" else partial(step, of) for name, of in made.items()}
    return Race(tasks, beside=beside, bars=bars("world", f"{bodies} bodies", task))


def pair_cases(options: Options):
    return grid(case=list(cases())[: 2 if options.quick else None], state=STATES)


def world_cases(options: Options):
    bodies = (1000 if options.quick else 5000,) if installed(pybullet="pybullet") else ()  # which settles them
    return grid(bodies=bodies, task=("move", "contacts"))


SIZES = (1, 10, 100, 1000, 10_000)
claim = partial(Claim, bar="median")
CLAIMS = [
    claim("pairs", "µs a pair", pair_cases, pairs, file="contacts-pairs"),
    claim("single", "µs a call", pair_cases, single, file="contacts-single"),
    claim("batches", "µs a pair in batches", lambda o: grid(poses=SIZES), batches, file="contacts-batches"),
    claim("meshes", "µs a pair", lambda o: grid(case=["box on ground", *(f"{m} on {m}" for m in meshes_here("bunny"))]),
          meshes, turns=5, file="contacts-meshes"),
    claim("world", "ms a step", world_cases, world, unit="ms", file="contacts-world"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
