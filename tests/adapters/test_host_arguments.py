"""Bad numbers through the drop-ins: what comes out is an error of collide, or the TypeError of the host's bindings.

Constructors, settable attributes and methods of coal's and python-fcl's stand-ins, and what programs of pybullet,
Pinocchio, MuJoCo and Newton call, are each given every bad value in the place of every argument; nothing of numpy's or
Python's own insides (OverflowError, IndexError, matmul) may come out.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterable, Iterator

import numpy as np
import pytest

from collide import Sphere
from collide.adapters.hosts import coal_api, fcl_api
from collide.adapters.hosts.bullet_mirror import Mirror
from collide.adapters.hosts.host_numbers import real, rows_of_three, shaped, whole
from collide.errors import CollideError, InvalidArgument
from collide.kernels import mode

NAN = float("nan")
BAD = {
    "huge": 10**400, "longer than Python writes": 10**5000, "nan": NAN, "inf": float("inf"), "none": None,
    "text": "abc", "complex": 1j, "object": object(), "minus one": -1, "pair": [1, 2], "three huge": [10**400] * 3,
    "three nan": [NAN] * 3, "three complex": np.ones(3) * 1j, "ragged": [[1, 2], [3]],
    "dates": np.array(["2020"], "M8"),
    "masked": np.ma.masked_array([1.0, 2.0, 3.0], [True, False, False]), "text array": np.array(["a", "b", "c"]),
}
E3 = np.eye(3)
CORNERS = np.vstack([E3, np.zeros(3)])


def arguments(api) -> dict[str, list]:
    transform = api.Transform3s if api is coal_api else api.Transform
    made = {
        "Box": [1, 1, 1], "Sphere": [1], "Ellipsoid": [1, 1, 1], "Capsule": [1, 1], "Cone": [1, 1], "Cylinder": [1, 1],
        "Halfspace": [[0, 0, 1], 0.0], "Plane": [[0, 0, 1], 0.0], "TriangleP": [*E3],
        "CollisionObject": [api.Sphere(1), transform()], transform.__name__: [E3, [0, 0, 0]],
        "Convex": [CORNERS, 1, [3, 0, 1, 2]] if api is fcl_api else [CORNERS, ()],
    }
    if api is coal_api:
        made |= {
            "Quaternion": [1, 0, 0, 0], "AngleAxis": [1.0, [0, 0, 1]], "Triangle": [0, 1, 2],
            "AABB": [[0, 0, 0], [1, 1, 1]],
            "HeightFieldAABB": [1.0, 1.0, np.eye(2)], "OcTree": [0.1], "ContactPatchRequest": [1, 12, 1e-3],
            "CollisionRequest": [coal_api.CollisionRequestFlag.CONTACT, 1],
        }
    return made


def calls(api, name: str) -> Iterator[tuple[str, Callable[[object], object]]]:
    """(what is called, it as a function of one bad value)."""
    kind, good = getattr(api, name), arguments(api)[name]
    for k in range(len(good)):
        yield f"{name}(argument {k})", lambda bad, k=k: kind(*good[:k], bad, *good[k + 1 :])
    for member in sorted(set(dir(kind)) - set(dir(object))):
        static = inspect.getattr_static(kind, member)
        if member.startswith("_") or isinstance(static, (staticmethod, classmethod)):
            continue
        if isinstance(static, property) and static.fset:
            yield f"{name}().{member} =", lambda bad, member=member: setattr(kind(*good), member, bad)
        elif inspect.isfunction(static):
            needed = [p for p in list(inspect.signature(static).parameters.values())[1:] if p.default is p.empty]
            if needed:
                n = len(needed)
                yield f"{name}().{member}", lambda bad, member=member, n=n: getattr(kind(*good), member)(*[bad] * n)


@pytest.mark.parametrize(("api", "name"), [(api, name) for api in (coal_api, fcl_api) for name in arguments(api)])
def test_bad_numbers_are_refused_in_the_hosts_way(api, name):
    counts = tried(f"{api.__name__}.", calls(api, name))
    assert counts["refused"] > counts["taken"], counts


def tried(where: str, calls: Iterable[tuple[str, Callable[[object], object]]]) -> dict[str, int]:
    """Each call with every bad value: how many were taken, how many refused; fails where another error came out."""
    counts, wrong = {"taken": 0, "refused": 0}, []
    for what, call in calls:
        for label, bad in BAD.items():
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    call(bad)
                counts["taken"] += 1
            except (CollideError, TypeError):
                counts["refused"] += 1
            except Exception as error:  # noqa: BLE001 - that is what is looked for
                wrong.append(f"{where}{what} {label}: {type(error).__name__}: {str(error)[:100]}")
    assert not wrong, "\n".join(wrong)
    return counts


def calls_of(function: Callable, good: dict) -> Iterator[tuple[str, Callable[[object], object]]]:
    """One call an argument, by its name, the others as they should be; it is called so once."""
    function(**good)
    for name in good:
        yield f"{function.__name__}({name})", lambda bad, name=name: function(**{**good, name: bad})


def test_pybullets_questions_refuse_bad_arguments(client):
    p = pytest.importorskip("pybullet")
    cube = p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.1, 0.1], physicsClientId=client)
    for x in (0.0, 0.15):
        p.createMultiBody(1.0, cube, basePosition=[x, 0, 0], physicsClientId=client)

    def mirror(**options) -> None:
        Mirror(**{"client": client, **options}).getContactPoints()

    counts = tried("", calls_of(mirror, {"client": client, "margins": "none", "shapes": {}, "contact_margin": 0.1}))
    questions = {
        "getClosestPoints": {
            "bodyA": 0, "bodyB": 1, "distance": 1.0, "linkIndexA": -1, "linkIndexB": -1, "collisionShapeA": -1,
        },
        "getContactPoints": {"bodyA": 0, "bodyB": 1, "linkIndexA": -1, "linkIndexB": -1},
        "getOverlappingObjects": {"aabbMin": [0, 0, 0], "aabbMax": [1, 1, 1]},
        "rayTest": {"rayFromPosition": [-1, 0, 0], "rayToPosition": E3[0], "collisionFilterMask": -1},
        "rayTestBatch": {
            "rayFromPositions": -E3, "rayToPositions": E3, "parentObjectUniqueId": 0, "parentLinkIndex": -1,
            "reportHitNumber": -1, "collisionFilterMask": -1, "fractionEpsilon": -1.0,
        },
        "setCollisionFilterGroupMask": {
            "bodyUniqueId": 0, "linkIndexA": -1, "collisionFilterGroup": 1, "collisionFilterMask": 1
        },
        "setCollisionFilterPair": {
            "bodyUniqueIdA": 0, "bodyUniqueIdB": 1, "linkIndexA": -1, "linkIndexB": -1, "enableCollision": 1
        },
        "set_shape": {"body": 0, "link": -1, "shape": Sphere(0.1)}, "refresh": {"body": 0},
        "note_body": {"body": 0, "flags": 0, "shapes": {}}, "note_margin": {"body": 0},
        "set_self_collision": {"body": 0, "flags": 0}, "set_filter_mode": {"mode": 1},
    }
    for name, good in questions.items():
        for what, call in calls_of(getattr(Mirror(client), name), good):
            more = tried("", [(what, call)])
            counts = {key: counts[key] + more[key] for key in counts}
    assert counts["refused"] > 8 * counts["taken"], counts


def test_nearest_points_within_no_number_are_refused(client):
    p = pytest.importorskip("pybullet")
    body = p.createMultiBody(1.0, p.createCollisionShape(p.GEOM_SPHERE, radius=1.0), physicsClientId=client)
    for call in (lambda mirror: mirror.getClosestPoints(body, body, NAN), lambda mirror: mirror.refresh(0.5)):
        with pytest.raises((InvalidArgument, TypeError), match=r"distance must.*nan|body must.*0\.5"):
            call(Mirror(client))


def test_pinocchios_questions_refuse_bad_arguments():
    pin = pytest.importorskip("pinocchio")
    from collide.adapters.hosts import pinocchio as host

    model = pin.buildSampleModelManipulator()
    geom_model = pin.buildSampleGeometryModelManipulator(model)
    geom_model.addAllCollisionPairs()
    good = {
        "model": model, "data": model.createData(), "geom_model": geom_model, "geom_data": geom_model.createData()
    }
    for function in (host.compute_collisions, host.compute_distances, host.distances):
        counts = tried("", calls_of(function, {**good, "q": pin.neutral(model)}))
        assert counts["taken"] == 1, f"{function.__name__}: q=None alone is taken, {counts}"
    assert tried("", calls_of(host.collides, {**good, "Q": pin.neutral(model)[None]}))["taken"] == 0


@pytest.mark.skipif(mode.MODE != mode.COMPILED, reason="MuJoCo's steps need the compiled library")
def test_mujocos_doors_refuse_bad_arguments():
    mujoco = pytest.importorskip("mujoco")
    from collide.adapters.hosts import mujoco as host

    model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom size="1"/></worldbody></mujoco>')

    def install(models, mode) -> None:
        host.install(models, mode).uninstall()

    assert tried("", calls_of(install, {"models": model, "mode": "cull"}))["taken"] == 0
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    counts = tried("", calls_of(host.world, {"model": model, "data": data}))
    assert counts["taken"] == 1, counts  # data=None


def test_newtons_pipeline_refuses_bad_arguments():
    newton = pytest.importorskip("newton")
    from collide.adapters.hosts.newton import Pipeline

    builder = newton.ModelBuilder()
    for _ in range(2):
        builder.add_shape_sphere(builder.add_body(), radius=0.5)
    model = builder.finalize(device="cpu")
    good = {
        "model": model, "rigid_contact_max": 8, "max_contacts": 4,
        "shape_pairs_filtered": model.shape_contact_pairs, "contact_report": False,
    }
    counts = tried("", calls_of(Pipeline, good))
    assert counts["refused"] > 4 * counts["taken"], counts


@pytest.mark.parametrize("api", [coal_api, fcl_api])
@pytest.mark.parametrize("bad", [NAN, 10**400])
def test_poses_that_are_no_numbers_are_refused_by_the_query(api, bad):
    transform = api.Transform3s if api is coal_api else api.Transform
    objects = [api.CollisionObject(api.Sphere(1.0), transform(E3, [x, 0, 0])) for x in (0.0, bad)]
    for ask, request, result in ((api.collide, api.CollisionRequest, api.CollisionResult),
                                 (api.distance, api.DistanceRequest, api.DistanceResult)):
        with pytest.raises(CollideError):
            ask(*objects, request(), result())


def test_messages_name_the_argument_and_the_value():
    for call, error, words in (
        (lambda: real("radius", "abc"), TypeError, ("radius", "'abc'")),
        (lambda: whole("num", NAN), InvalidArgument, ("num", "nan")),
        (lambda: shaped("T", [1, 2], (3,)), InvalidArgument, ("T", "(3,)", "(2,)")),
        (lambda: shaped("T", [1, 1j, 2], (3,)), InvalidArgument, ("T", "complex")),
        (lambda: rows_of_three("ps", E3[0]), InvalidArgument, ("ps", "(n, 3)", "(3,)")),
        (lambda: fcl_api.Box(1, 10**400, 1), CollideError, ("Box", "size", "inf")),
    ):
        with pytest.raises(error) as caught:
            call()
        assert all(word in str(caught.value) for word in words), caught.value
