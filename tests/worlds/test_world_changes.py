"""A World under any order of changes: added to, removed from, moved, filtered, with margins, asleep. Every answer is
that of balls in numpy, which share no code with the engine; forty thousand changes leave no drift and no leak.
"""

from __future__ import annotations

import gc
import sys

import naive
import numpy as np
import pytest
from naive import pose, random_pose, rng_of

import collide

RADII = (0.1, 0.2, 0.35, 0.9)
BALLS = [collide.Sphere(radius) for radius in RADII]
KINDS = ["add", "remove", "move", "move", "move", "move all", "shift", "allow", "margin", "pair", "sleep", "wake"]


class Model:
    """The same bodies in dictionaries, and what is to be answered about them."""

    def __init__(self, seed: int):
        self.rng, self.world = rng_of("changes of worlds", seed), collide.World()
        self.seed, self.step = seed, 0
        self.bodies: dict[int, dict] = {}
        self.allowed: set[tuple[int, int]] = set()
        self.pair_margins: dict[tuple[int, int], float] = {}
        self.done: dict[str, int] = {}

    def some(self, k: int) -> list[int]:
        ids = list(self.bodies)
        return [ids[place] for place in self.rng.choice(len(ids), min(k, len(ids)), replace=False).tolist()]

    def change(self) -> None:
        """One of all changes, at random."""
        rng, world = self.rng, self.world
        what = KINDS[int(rng.integers(len(KINDS)))]
        if not 20 < len(self.bodies) < 70:
            what = "add" if len(self.bodies) <= 20 else "remove"
        if what == "add":
            radius = int(rng.integers(len(BALLS)))
            body = {
                "radius": RADII[radius], "p": rng.uniform(-2, 2, 3), "static": bool(rng.random() < 0.3),
                "group": int(rng.choice([1, 2, 3])), "mask": int(rng.choice([1, 2, 3, 3])),
                "margin": float(rng.choice([0, 0, 0, 0.05])), "asleep": False,
            }
            traits = {name: body[name] for name in ("static", "group", "mask", "margin")}
            self.bodies[world.add(BALLS[radius], pose(t=body["p"]), **traits)] = body
        elif what == "remove":
            (identity,) = self.some(1)
            world.remove(identity)
            del self.bodies[identity]
            self.allowed = {pair for pair in self.allowed if identity not in pair}
            self.pair_margins = {pair: m for pair, m in self.pair_margins.items() if identity not in pair}
        elif what in ("move", "move all", "shift"):
            ids = list(self.bodies) if what == "move all" else self.some(int(rng.integers(1, 4)))
            for identity in ids:
                body = self.bodies[identity]
                body["p"] = body["p"] + rng.normal(size=3) * 0.01 if what == "shift" else rng.uniform(-2, 2, 3)
            X = np.array([pose(t=self.bodies[identity]["p"]) for identity in ids])
            if len(ids) == 1:
                world.set_pose(ids[0], X[0])
            else:
                world.set_poses(ids, X)
        elif what in ("allow", "pair"):
            i, j = sorted(self.some(2))
            margin = float(rng.choice([0.0, 0.02, 0.3]))
            if what == "allow" and len(self.allowed) < 200:
                self.allowed.add((i, j))
                world.allow(j, i)
            elif what == "pair" and rng.random() < 0.5:
                self.pair_margins[i, j] = margin
                world.set_margin(i, margin, partner=j)
            elif what == "pair":
                self.pair_margins.pop((i, j), None)
                world.set_margin(j, None, partner=i)
        elif what == "margin":
            (identity,) = self.some(1)
            margin = float(rng.choice([0.0, 0.0, 0.1]))
            self.bodies[identity]["margin"] = margin
            world.set_margin(identity, margin)
        else:
            ids = self.some(3)
            for identity in ids:
                self.bodies[identity]["asleep"] = what == "sleep"
            (world.sleep if what == "sleep" else world.wake)(ids)
        self.done[what] = self.done.get(what, 0) + 1
        self.step += 1

    def gaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """((k, 2) ids of tested pairs, (k,) their distances, (k,) their margins)."""
        ids = np.array(sorted(self.bodies))
        names = next(iter(self.bodies.values()))
        column = {name: np.array([self.bodies[k][name] for k in ids.tolist()]) for name in names}
        i, j = np.triu_indices(len(ids), 1)
        still = column["static"] | column["asleep"]
        tested = ~(still[i] & still[j]) & ((column["group"][i] & column["mask"][j]) != 0)
        tested &= (column["group"][j] & column["mask"][i]) != 0
        pairs = np.stack([ids[i], ids[j]], axis=1)
        tested &= np.array([tuple(pair) not in self.allowed for pair in pairs.tolist()], dtype=bool)
        i, j, pairs = i[tested], j[tested], pairs[tested]
        distances = np.linalg.norm(column["p"][i] - column["p"][j], axis=1) - column["radius"][i] - column["radius"][j]
        margins = column["margin"][i] + column["margin"][j]
        margins = np.array([self.pair_margins.get(tuple(p), m) for p, m in zip(pairs.tolist(), margins.tolist())])
        return pairs, distances, margins

    def snippet(self) -> str:
        lines = [f"# seed {self.seed}, after {self.step} changes", "world = collide.World(); ids = {}"]
        for identity, body in self.bodies.items():
            lines.append(
                f"ids[{identity}] = world.add(collide.Sphere({body['radius']}), collide.pose({body['p'].tolist()}), "
                f"static={body['static']}, group={body['group']}, mask={body['mask']}, margin={body['margin']})"
            )
        lines += [f"world.sleep([ids[{k}]])" for k, body in self.bodies.items() if body["asleep"]]
        lines += [f"world.allow(ids[{i}], ids[{j}])" for i, j in sorted(self.allowed)]
        lines += [f"world.set_margin(ids[{i}], {m}, partner=ids[{j}])" for (i, j), m in self.pair_margins.items()]
        return "\n".join(lines)

    def check(self) -> tuple[int, int]:
        """Every question about all pairs; (hits, tested pairs)."""
        world, (pairs, distances, margins) = self.world, self.gaps()
        hits = pairs[distances <= margins]
        rows = world.collisions()
        assert np.array_equal(np.stack([rows["a"], rows["b"]], axis=1), hits), self.snippet()
        self.check_stats(len(pairs))
        assert world.collides() == bool(len(hits)), self.snippet()
        for limit in (0.0, 0.25):
            near = distances <= limit
            rows = world.distances(limit)
            assert np.array_equal(np.stack([rows["a"], rows["b"]], axis=1), pairs[near]), self.snippet()
            assert np.allclose(rows["distance"], distances[near], rtol=0, atol=1e-12), self.snippet()
            self.check_stats(len(pairs))
        row = world.minimum()
        if len(pairs):
            k = int(np.argmin(distances))
            assert [row["a"][0], row["b"][0]] == pairs[k].tolist(), self.snippet()
            assert row["distance"][0] == pytest.approx(distances[k], abs=1e-12)
        else:
            assert len(row) == 0
        return len(hits), len(pairs)

    def check_stats(self, n_tested: int) -> None:
        """Every pair is accounted for once, under every filter at the same time."""
        stats = self.world.stats
        n = len(self.bodies)
        skipped = dict(stats["skipped"])
        assert stats["bodies"] == n and stats["pairs"] == n * (n - 1) // 2
        assert stats["sleeping"] == sum(body["asleep"] for body in self.bodies.values())
        culled = skipped.pop("broadphase")
        assert culled + stats["narrowphase"] == n_tested, self.snippet()
        assert sum(skipped.values()) + n_tested == stats["pairs"], self.snippet()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_any_order_of_changes_equals_brute_force(seed):
    model, hits, tested = Model(seed), 0, 0
    for _ in range(200):
        for _ in range(int(model.rng.integers(1, 6))):
            model.change()
        found = model.check()
        hits, tested = hits + found[0], tested + found[1]
    assert 0.02 < hits / tested < 0.5, "the hit rate of the test"
    assert set(model.done) == set(KINDS)


@pytest.mark.slow
def test_forty_thousand_changes_leave_no_drift_and_no_leak():
    model, held = Model(99), []
    for _ in range(10):
        for _ in range(80):
            for _ in range(50):
                model.change()
            model.world.collides()
        model.check()
        gc.collect()
        held.append((sys.getallocatedblocks(), model.world._pack().nbytes))
    assert model.step >= 40_000
    (blocks, nbytes), (blocks_after, nbytes_after) = np.max(held[2:5], axis=0), np.min(held[7:], axis=0)
    assert blocks_after < blocks + 2000 and nbytes_after < 1.5 * nbytes, held
    fresh = collide.World()
    ids = {}
    for identity in sorted(model.bodies):
        body = model.world.body(identity)
        traits = {name: getattr(body, name) for name in ("static", "group", "mask", "margin")}
        ids[identity] = fresh.add(body.shape, body.X_WB, name=body.name, **traits)
        fresh.sleep([ids[identity]] if body.sleeping else [])
    for i, j in model.allowed:
        fresh.allow(ids[i], ids[j])
    for (i, j), margin in model.pair_margins.items():
        fresh.set_margin(ids[i], margin, partner=ids[j])
    rows, other = model.world.distances(0.3), fresh.distances(0.3)
    fields = [field for field in naive.ANSWER_FIELDS if field != "iterations"]
    assert len(rows) == len(other) > 0 and not naive.same_bits(rows.rows, other.rows, fields)


@pytest.mark.parametrize("seed", range(3))
def test_shapes_of_every_kind_under_changes_equal_asking_every_pair(seed):
    """Unions, half-spaces and curved shapes; bit by bit what pairs asked alone are told."""
    rng, world, n_hits, n_rows = rng_of("kinds under changes", seed), collide.World(), 0, 0
    kinds = list(naive.KINDS)
    fields = [field for field in naive.ANSWER_FIELDS if field != "iterations"]
    for step in range(12):
        for _ in range(6):
            kind = kinds[int(rng.integers(len(kinds)))]
            world.add(naive.one_of_each(rng)[kind], random_pose(rng, 1.6), static=bool(rng.random() < 0.2))
        for identity in rng.permutation(world.ids)[: len(world) // 6 if step else 0].tolist():
            world.remove(identity)
        moved = rng.permutation(world.ids)[: int(rng.integers(0, 12))].tolist()
        world.set_poses(moved, np.array([random_pose(rng, 1.6) for _ in moved]).reshape(-1, 4, 4))
        wanted = naive.brute_force(world, 0.1)
        rows = world.distances(0.1)
        assert [(row["a"], row["b"]) for row in rows] == [(a, b) for a, b, _ in wanted], (seed, step)
        for row, (a, b, other) in zip(rows, wanted):
            assert other is None or not naive.same_bits(row, other, fields), (seed, step, a, b)
        n_hits, n_rows = n_hits + int(rows["hit"].sum()), n_rows + len(rows)
    assert 0.2 < n_hits / n_rows < 0.98 and n_rows > 100


ENDLESS = {
    "half-space": collide.Halfspace((0, 0, 1), 0.0),
    "region": collide.HPolytope([[0, 0, 1], [0.3, 0, 1]], [0.0, 0.1], bounded=False),
    "slab": collide.HPolytope([[0, 0, 1], [0, 0, -1]], [0.0, 1.0], bounded=False),
    "union with a half-space": collide.Compound([
        (collide.Halfspace((0, 0, 1), 0.0), np.eye(4)), (collide.Sphere(0.2), pose(t=(0, 0, -1)))
    ]),
}


@pytest.mark.parametrize("kind", ENDLESS)
@pytest.mark.parametrize("change", ["move", "margin and back", "pair margin and back", "remove", "add", "sleep"])
def test_bodies_without_end_stay_found_whatever_changes_beside_margins(kind, change):
    """A bound of ∞ and no margin of its own: 0 · ∞ once was the room its box was given, and the body was lost."""
    world = collide.World()
    ground, ball = world.add(ENDLESS[kind]), world.add(collide.Sphere(0.5), margin=0.1)
    far = world.add(collide.Sphere(0.5), pose(t=(0, 0, 9)), margin=0.2)
    assert world.collides()
    if change == "move":
        world.set_pose(ground, np.eye(4))
    elif change == "margin and back":
        world.set_margin(ground, 0.3)
        world.collides()
        world.set_margin(ground, 0.0)
    elif change == "pair margin and back":
        world.set_margin(ground, 0.3, partner=ball)
        world.collides()
        world.set_margin(ground, None, partner=ball)
    elif change == "remove":
        world.remove(far)
    elif change == "add":
        ground = world.add(ENDLESS[kind])
        world.remove(0)
    elif change == "sleep":
        world.sleep([ground])
    assert world.collides()
    ends = sorted((ground, ball))
    for rows in (world.collisions(), world.distances(0.05), world.minimum()):
        assert [row.tolist() for row in (rows["a"], rows["b"])] == [ends[:1], ends[1:]], change
    assert not np.isnan(world._pack().tree.boxes).any()
