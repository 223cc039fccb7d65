"""The verdict of every body, against all pairs looked at one by one in integers."""

from __future__ import annotations

import random
from collections import Counter
from types import SimpleNamespace

from collide import Box, Sphere, pose
from collide.pages.body_verdicts import ORDER, bodies_in_tested_pairs, body_verdicts, verdict_columns, worst
from collide.reports import report
from collide.scenes import Scene, SceneBody

SEED = 23
#: Clearance in integer units of the scenes below.
CLEARANCE = 2


def random_scene(draw: random.Random):
    """Balls of whole radii at whole places, with filters, as a scene and as plain tuples."""
    balls = [
        (
            [draw.randint(0, 30), draw.choice((0, 0, 3, 4)), 0], draw.randint(1, 3), draw.random() < 0.3,
            draw.choice((1, 2, 3)), draw.choice((0, 1, 3, 3)),
        )
        for _ in range(draw.randint(1, 12))
    ]
    n = len(balls)
    allowed = [tuple(draw.sample(range(n), 2)) for _ in range(draw.randint(0, n))] if n > 1 else []
    scene = Scene("balls", [
        SceneBody(f"b{k}", Sphere(float(r)), pose([float(x) for x in at]), static=static, group=group, mask=mask)
        for k, (at, r, static, group, mask) in enumerate(balls)
    ])
    scene.allowed = [(f"b{i}", f"b{j}", "test") for i, j in allowed]
    return scene, balls, {frozenset(pair) for pair in allowed}


def naive_verdicts(balls, left_out) -> list[str]:
    """Pair by pair, squared distances as integers."""
    classes: list[set] = [set() for _ in balls]
    for i, (at, r, static, group, mask) in enumerate(balls):
        for j, (other_at, other_r, other_static, other_group, other_mask) in enumerate(balls[:i]):
            if (static and other_static) or not group & other_mask or not other_group & mask or {i, j} in left_out:
                continue
            square, sum_r = sum((x - y) ** 2 for x, y in zip(at, other_at)), r + other_r
            if square < sum_r**2:
                verdict = "colliding"
            elif square == sum_r**2:
                verdict = "touching"
            else:
                verdict = "near" if square <= (sum_r + CLEARANCE) ** 2 else "free"
            classes[i].add(verdict)
            classes[j].add(verdict)
    order = ("colliding", "touching", "near", "free")
    return [next((verdict for verdict in order if verdict in some), "never tested") for some in classes]


def test_verdicts_are_those_of_all_pairs():
    draw = random.Random(SEED)
    seen: Counter = Counter()
    for k in range(60):
        scene, balls, left_out = random_scene(draw)
        verdicts = body_verdicts(scene, report.make(scene, clearance=float(CLEARANCE)))
        wanted = naive_verdicts(balls, left_out)
        assert list(verdicts.values()) == wanted, f"scene {k}: {balls}, {left_out}"
        assert list(verdicts) == [body.name for body in scene.bodies]
        seen.update(wanted)
    assert min(seen[v] for v in ("colliding", "touching", "near", "free", "never tested")) >= 10, seen


def test_what_is_ignored_or_not_answered():
    bodies = [SceneBody(name, Box((1, 1, 1)), pose((4.0 * k, 0, 0))) for k, name in enumerate("abc")]
    scene = Scene("row", bodies)
    made = report.make(scene, ignore=[("a", "b"), ("a", "c")])
    assert body_verdicts(scene, made) == {"a": "never tested", "b": "free", "c": "free"}
    made.unanswered = [{"a": "b", "b": "c", "why": "test"}]
    assert body_verdicts(scene, made) == {"a": "never tested", "b": "not answered", "c": "not answered"}


def test_shallow_is_worse_than_touching():
    bodies = [SceneBody(name, Box((1, 1, 1)), pose((x, 0, 0))) for name, x in (("a", 0.0), ("b", 0.999))]
    scene = Scene("two", bodies)
    assert set(body_verdicts(scene, report.make(scene, min_depth=0.01)).values()) == {"shallow"}
    assert worst(["near", "not answered", "shallow", "touching"]) == "shallow" and worst([]) == "free"
    assert list(ORDER) == sorted(ORDER, key=lambda verdict: ORDER.index(worst([verdict])))


def test_a_pair_left_out_twice_counts_once():
    bodies = [SimpleNamespace(name=name, static=False, group=1, mask=1) for name in "abc"]
    scene = SimpleNamespace(bodies=bodies, allowed=[("a", "b", ""), ("b", "a", ""), ("a", "a", ""), ("a", "x", "")])
    assert bodies_in_tested_pairs(scene) == {"a", "b", "c"}
    assert bodies_in_tested_pairs(scene, [("c", "a"), ("a", "b")]) == {"b", "c"}


def test_columns_are_by_row():
    verdicts = {"x": "near", "y": "free", "z": "colliding", "w": "never tested"}
    assert verdict_columns(verdicts, {"w": 3, "z": 0, "y": 1, "x": 2}) == [[0, "colliding"], [2, "near"]]
