"""``import pinocchio`` with collide's collisions and distances: every form of arguments, beside Pinocchio itself."""

from __future__ import annotations

import itertools
import subprocess
import sys

import numpy as np
import pytest

pin = pytest.importorskip("pinocchio", reason="Pinocchio (pin) is not installed")

from collide import InvalidArgument, UnsupportedQuery
from collide.adapters.hosts import pinocchio as host
from collide.adapters.hosts import pinocchio_module

N_CONFIGURATIONS = 40


@pytest.fixture(scope="module")
def module():
    with pytest.warns(RuntimeWarning, match="hold pinocchio already: .*test_pinocchio_module"):
        installing = pinocchio_module.install()
    with installing as installed:
        yield installed


@pytest.fixture
def arm():
    """(model, data, geometry model, geometry data) of Pinocchio's sample manipulator, without the five pairs that touch
    in a point, to rounding, at all configurations, and a pair that always overlaps.
    """
    model = pin.buildSampleModelManipulator()
    geom_model = pin.buildSampleGeometryModelManipulator(model)
    for i, j in set(itertools.combinations(range(6), 2)) - {(0, 3), (1, 3), (1, 4), (2, 4), (4, 5), (2, 5)}:
        geom_model.addCollisionPair(pin.CollisionPair(i, j))
    return model, model.createData(), geom_model, geom_model.createData()


def configurations(seed):
    return np.random.default_rng(seed).uniform(-3.0, 3.0, (N_CONFIGURATIONS, 6))


def written(geom_data):
    return [(r.isCollision(), r.numContacts()) for r in geom_data.collisionResults]


def test_every_form_of_collisions_is_pinocchios(module, arm):
    model, data, geom_model, geom_data = arm
    manager = module.BroadPhaseManager_DynamicAABBTreeCollisionManager(model, geom_model, geom_data)
    n_hits = 0
    for q in configurations(1):
        theirs = pin.computeCollisions(model, data, geom_model, geom_data, q, False)
        expected = written(geom_data)
        n_hits += theirs
        assert module.computeCollisions(model, data, geom_model, geom_data, q) is theirs
        assert [hit for hit, _ in written(geom_data)] == [hit for hit, _ in expected]
        assert module.computeCollisions(geom_model, geom_data) is theirs
        assert module.computeCollisions(geometry_model=geom_model, geometry_data=geom_data) is theirs
        assert module.computeCollisions(geom_model, geom_data, True) is theirs
        assert module.computeCollisions(manager) is theirs
        assert module.computeCollisions(manager, stop_at_first_collision=True) is theirs
        assert module.computeCollisions(model, data, manager, q, False) is theirs
        assert module.computeCollisionsInParallel(2, geom_model, geom_data) is theirs
        assert module.computeCollisionsInParallel(2, model, data, geom_model, geom_data, q) is theirs
        for k, (hit, _) in enumerate(expected):
            assert module.computeCollision(geom_model, geom_data, k) is hit
    assert 0 < n_hits < N_CONFIGURATIONS


def test_a_request_of_ones_own_counts(module, arm):
    model, data, geom_model, geom_data = arm
    module.updateGeometryPlacements(model, data, geom_model, geom_data, configurations(2)[0])
    request = pin.coal.CollisionRequest()
    request.security_margin = 10.0
    assert module.computeCollision(geom_model, geom_data, 0, request)
    request.security_margin = -10.0
    assert not module.computeCollision(geom_model, geom_data, 0, collision_request=request)


def test_distances_are_pinocchios(module, arm):
    model, data, geom_model, geom_data = arm
    others = geom_model.createData()
    n_apart = 0
    for q in configurations(3)[:10]:
        pin.computeDistances(model, data, geom_model, others, q)
        nearest = module.computeDistances(model, data, geom_model, geom_data, q)
        gaps = np.array([r.min_distance for r in others.distanceResults])
        ours = np.array([r.min_distance for r in geom_data.distanceResults])
        apart = gaps > 1e-6
        n_apart += apart.sum()
        assert np.allclose(ours[apart], gaps[apart], atol=1e-6) and (ours[~apart] < 1e-5).all()
        assert ours[nearest] == ours.min() and module.computeDistances(geom_model, geom_data) == nearest
        for k in (0, len(ours) - 1):
            assert module.computeDistance(geom_model, geom_data, k).min_distance == ours[k]
    assert n_apart > 20


@pytest.mark.parametrize("kind", ["GeometryPool", "BroadPhaseManagerPool_DynamicAABBTreeCollisionManager"])
def test_pools_answer_column_by_column(module, arm, kind):
    model, data, geom_model, geom_data = arm
    pool = getattr(module, kind)(model, geom_model, 2)
    Q = configurations(4)
    hits = module.computeCollisionsInParallel(2, pool, np.asfortranarray(Q.T))
    expected = [pin.computeCollisions(model, data, geom_model, geom_data, q, False) for q in Q]
    assert hits.dtype == bool and hits.tolist() == expected and 0 < sum(expected) < len(Q)
    first = module.computeCollisionsInParallel(2, pool, Q.T, True, True)
    assert np.flatnonzero(first).tolist() == [expected.index(True)]


def test_bad_input_is_named(module, arm):
    model, data, geom_model, geom_data = arm
    manager = module.BroadPhaseManager_DynamicAABBTreeCollisionManager(model, geom_model, geom_data)
    callback = pin.CollisionCallBackDefault(geom_model, geom_data, False)
    q = np.zeros(6)
    for arguments, error, words in (
        ((manager, callback), UnsupportedQuery, "CollisionCallBackDefault can be written by Pinocchio alone"),
        ((model, data, manager, callback, q), UnsupportedQuery, "__wrapped__"),
        ((), TypeError, "takes a geometry model, a model or a broadphase manager first"),
        ((3,), TypeError, "first, got 3"),
        ((geom_model,), TypeError, "takes .geometry_model, geometry_data, stop_at_first_collision"),
        ((model, data, geom_model, geom_data, np.zeros(5)), InvalidArgument, "q must have shape"),
    ):
        with pytest.raises(error, match=words):
            module.computeCollisions(*arguments)
    with pytest.raises(TypeError, match="not margin"):
        module.computeCollisions(geom_model, geom_data, margin=1.0)
    with pytest.raises(InvalidArgument, match="pair_index must be one of"):
        module.computeCollision(geom_model, geom_data, 10_000)
    with pytest.raises(InvalidArgument, match="num_thread"):
        module.computeCollisionsInParallel(0, geom_model, geom_data)
    with pytest.raises(TypeError, match="takes a pool or models"):
        module.computeCollisionsInParallel(2, 5, q)


def test_imports_find_it_and_all_else_is_pinocchios():
    code = """
import sys
import pinocchio as genuine
from collide.adapters.hosts import pinocchio_module as host
with host.install() as module:
    import pinocchio
    import pinocchio.visualize
    from pinocchio import SE3, computeCollisions
    from pinocchio.utils import zero
    assert pinocchio is module is sys.modules["pinocchio"] and host.installed()
    assert SE3 is genuine.SE3 and computeCollisions is not genuine.computeCollisions
    assert pinocchio.__version__ == genuine.__version__ and "SE3" in dir(pinocchio)
    assert pinocchio.RobotWrapper and pinocchio.__wrapped__ is genuine
    host.install()
import pinocchio as again
assert again is genuine and not host.installed()
host.uninstall()
print("all held")
"""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.stdout.strip().endswith("all held"), done.stderr


def test_the_same_answers_as_the_functions_of_the_adapter(module, arm):
    model, data, geom_model, geom_data = arm
    for q in configurations(5)[:5]:
        assert module.computeCollisions(model, data, geom_model, geom_data, q) == host.compute_collisions(*arm, q)
