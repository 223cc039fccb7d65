"""Hundreds of random steps of a checker in use, of which each is judged by a checker made anew, and by pairs of shapes
asked one by one: objects attached and put down, pairs allowed, bodies of the World added, moved and removed, questions.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from naive import random_pose, rng_of
from random_robots import random_configurations, random_link_shape, random_robot, ring, some_spheres

import collide

ASKED = 6
#: Of the asked configurations at least this share collides, and as many do not.
LEAST_SHARE = 0.15


def hulls(rng, size: float) -> collide.Shape:
    return collide.ConvexHull(0.6 * size * rng.normal(size=(12, 3)))


def frames(rng, size: float) -> collide.Shape:
    """Square frames, whose hulls fill the hole, and tetrahedra without a side."""
    if rng.random() < 0.5:
        made = ring()
        return collide.Mesh(size * made.vertices, made.faces)
    return collide.Mesh(size * rng.normal(size=(4, 3)), [(0, 1, 2), (0, 1, 3), (1, 2, 3)], solid=False)


KINDS = {"spheres": some_spheres, "hulls": hulls, "meshes": frames}


class Steps:
    """A checker in use, and what it has been told since: objects and pairs, by which another is made anew."""

    def __init__(self, kind: str, padding: float, seed: int):
        self.rng, self.made_of, self.padding = rng_of("steps", kind, seed), KINDS[kind], padding
        self.robot, self.world = random_robot(self.rng, 6, shape=self.made_of, size=0.06), collide.World()
        self.shapes = [self.made_of(self.rng, 0.12) for _ in range(3)]
        self.shapes += [random_link_shape(self.rng, 0.12) for _ in range(5)] + [collide.Halfspace((0, 0, 1.0), -1.5)]
        self.objects: dict[str, tuple] = {}
        self.pairs: list[tuple[str, str]] = []
        self.numbers = itertools.count()
        for _ in range(4):
            self.add()
        self.checker = collide.RobotChecker(self.robot, self.world, padding=padding)

    def one_of(self, values):
        values = list(values)
        return values[int(self.rng.integers(len(values)))]

    def around(self) -> list[str]:
        return list(self.world.names.values())

    def add(self):
        shape = self.one_of([random_link_shape(self.rng, 0.3), self.made_of(self.rng, 0.3)])
        self.world.add(shape, random_pose(self.rng, 0.8), name=f"body{next(self.numbers)}",
                       static=bool(self.rng.random() < 0.3), margin=0.02 * (self.rng.random() < 0.1))

    def remove(self):
        if self.around():
            name = self.one_of(self.around())
            self.world.remove(name)
            self.pairs = [pair for pair in self.pairs if name not in pair]

    def move(self):
        if self.around():
            X = random_pose(self.rng, 0.8)
            if self.rng.random() < 0.1:  # not quite a rotation: boxes need other slack
                X[0, 1] += 1e-9
            self.world.set_pose(self.one_of(self.around()), X)

    def attach(self):
        name = self.one_of({f"part{k}" for k in range(8)} - self.objects.keys() or [None])
        if name is None:
            return
        X = np.eye(4) if self.rng.random() < 0.2 else random_pose(self.rng, 0.2)
        touch = [self.one_of([*self.robot.links, *self.around(), *self.objects])] * (self.rng.random() < 0.4)
        shape = self.one_of(self.shapes if self.rng.random() < 0.9 else [random_link_shape(self.rng, 0.2)])
        item = self.one_of(self.robot.links), shape, X, tuple(touch)
        self.checker.attach(name, *item[:3], touch=item[3])
        self.objects[name] = item

    def detach(self):
        if self.objects:
            name = self.one_of(self.objects)
            self.checker.detach(name)
            del self.objects[name]
            self.pairs = [pair for pair in self.pairs if name not in pair]

    def allow(self):
        a, b = [*self.robot.links, *self.objects], [*self.objects, *self.around(), *self.robot.links[:2]]
        pair = self.one_of(a), self.one_of(b)
        if pair[0] != pair[1] and len(self.pairs) < 8:  # else everything is allowed in the end
            self.checker.allow(*pair)
            self.pairs.append(pair)

    def anew(self) -> collide.RobotChecker:
        objects = [(name, *item) for name, item in self.objects.items()]
        return collide.RobotChecker(
            self.robot, self.world, attached=objects, allowed=self.pairs, padding=self.padding)

    def tested(self):
        """(shape, link, shape, link or None, X_WB or None) of each pair that is to be tested, from names alone; of
        bodies without a padding and without margins.
        """
        robot, world = self.robot, self.world
        link_of = {link: link for link in robot.links} | {name: item[0] for name, item in self.objects.items()}
        never = {frozenset(pair[:2]) for pair in (*robot.disabled_pairs, *self.pairs)}
        never |= {frozenset((name, other)) for name, item in self.objects.items() for other in (item[0], *item[3])}
        shapes = {link: collide.Compound([(e.shape, e.X_LG) for e in robot.geometry[link]]) for link in robot.links}
        shapes |= {name: collide.Compound([(item[1], item[2])]) for name, item in self.objects.items()}
        for a, b in itertools.combinations(shapes, 2):
            if link_of[a] != link_of[b] and frozenset((a, b)) not in never:
                yield shapes[a], link_of[a], shapes[b], link_of[b], None
        for name, body in ((name, world.body(name)) for name in world.names.values()):
            for a, shape in shapes.items():
                if frozenset((a, name)) not in never and not (body.static and link_of[a] in robot.base_links):
                    yield shape, link_of[a], body.shape, None, body.X_WB

    def hits(self, Q: np.ndarray) -> list[bool]:
        """Whether any pair meets, by `collide.collide`."""
        X_WLs, number, hits = self.robot.link_poses(Q), self.robot.links.index, np.zeros(len(Q), dtype=bool)
        for A, a, B, b, X_WB in self.tested():
            X_WBs = np.broadcast_to(X_WB, (len(Q), 4, 4)) if b is None else X_WLs[:, number(b)]
            hits |= collide.collide(A, B, np.ascontiguousarray(X_WLs[:, number(a)]), np.ascontiguousarray(X_WBs))
        return hits.tolist()


def report_of(checker: collide.RobotChecker, q: np.ndarray) -> str:
    try:
        return str(checker.explain(q))
    except collide.UnsupportedQuery as error:  # a union deep in a half-space
        return str(error)


def told(checker: collide.RobotChecker, Q: np.ndarray, is_short: bool) -> dict:
    out = {
        "alone": [checker.collides(q) for q in Q], "batch": checker.collides(Q).tolist(), "bodies": checker.bodies,
        "around": checker.around, "n_pairs": checker.n_pairs, "skipped": checker.skipped,
    }
    if is_short:
        return out
    near = checker.distances(Q, per="link")
    return out | {
        "distances": near.distance.tobytes(), "names": near.names, "report": report_of(checker, Q[0]),
        "sampled": checker.edge_collides(Q[:-1], Q[1:], resolution=0.2).tolist(),
    }


@pytest.mark.many(2)
@pytest.mark.parametrize("padding", [0.0, 0.01])
@pytest.mark.parametrize(("kind", "n_steps"), [
    ("spheres", 40), ("hulls", 40), *(pytest.param(kind, 300, marks=pytest.mark.slow) for kind in KINDS)])
def test_after_each_of_many_steps_answers_are_those_of_a_checker_made_anew(kind, n_steps, padding):
    """At half of the steps the checkers get spheres and maps."""
    steps, n_asked, n_hits, n_judged, n_proven, counts = Steps(kind, padding, 11 + n_steps), 0, 0, 0, [0, 0], {}
    ways = [steps.attach] * 3 + [steps.detach] * 2 + [steps.allow, steps.add, steps.move, steps.move, steps.remove]
    for step in range(n_steps):
        way = steps.one_of(ways)
        way()
        counts[way.__name__] = counts.get(way.__name__, 0) + 1
        if len(steps.around()) > 8:
            steps.remove()
        if step == n_steps // 2:
            steps.checker._count(10**6)
        if steps.rng.random() < 0.3:
            continue  # several changes before the next question
        Q, fresh, case = random_configurations(steps.rng, steps.robot, ASKED), steps.anew(), (kind, padding, step)
        is_short = kind == "meshes" and step % 6 > 0  # distances of meshes take most of the time
        now, expected = told(steps.checker, Q, is_short), told(fresh, Q, is_short)
        assert now == expected, (case, {key: (now[key], expected[key]) for key in now if now[key] != expected[key]})
        assert now["alone"] == now["batch"], case
        begins, ends = Q[:-1], Q[:-1] + 0.1 * (Q[1:] - Q[:-1])
        if is_short:
            begins, ends = begins[:2], ends[:2]
        here, there = (checker.certify_edges(begins, ends, resolution=0.02) for checker in (steps.checker, fresh))
        assert not ((here.free & there.collides) | (there.free & here.collides)).any(), case
        if step < n_steps // 2:
            assert here.free.tobytes() == there.free.tobytes() and here.time.tobytes() == there.time.tobytes(), case
        n_proven = [n_proven[0] + int(here.free.sum()), n_proven[1] + int(here.collides.sum())]
        n_asked, n_hits = n_asked + ASKED, n_hits + sum(now["batch"])
        if not padding and not any(steps.world.body(name).margin for name in steps.around()):
            assert now["batch"] == steps.hits(Q), case
            n_judged += 1
    assert LEAST_SHARE * n_asked <= n_hits <= (1.0 - LEAST_SHARE) * n_asked, (n_hits, n_asked)
    n_least = min(counts.get(way.__name__, 0) for way in ways)
    assert n_least >= n_steps // 20 and min(n_proven) >= n_steps // 6, (counts, n_proven)
    assert n_judged >= n_steps // 8 or padding
