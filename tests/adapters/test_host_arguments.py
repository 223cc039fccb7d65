"""Bad numbers through the drop-ins: what comes out is an error of collide, or the TypeError of the host's bindings.

Constructors, settable attributes and methods of coal's and python-fcl's stand-ins are each given every bad value in the
place of every argument; nothing of numpy's or Python's own insides (OverflowError, IndexError, matmul) may come out.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from collide.adapters.hosts import coal_api, fcl_api
from collide.adapters.hosts.host_numbers import real, rows_of_three, shaped, whole
from collide.errors import CollideError, InvalidArgument

NAN = float("nan")
BAD = {
    "huge": 10**400, "longer than Python writes": 10**5000, "nan": NAN, "inf": float("inf"), "none": None,
    "text": "abc", "complex": 1j, "object": object(), "minus one": -1, "pair": [1, 2], "three huge": [10**400] * 3,
    "three nan": [NAN] * 3, "three complex": np.ones(3) * 1j, "ragged": [[1, 2], [3]],
    "dates": np.array(["2020"], "M8"),
    "masked": np.ma.masked_array([1.0, 2.0, 3.0], [True, False, False]), "text array": np.array(["a", "b", "c"]),
}  # fmt: skip
E3 = np.eye(3)
CORNERS = np.vstack([E3, np.zeros(3)])


def arguments(api) -> dict[str, list]:
    transform = api.Transform3s if api is coal_api else api.Transform
    made = {
        "Box": [1, 1, 1], "Sphere": [1], "Ellipsoid": [1, 1, 1], "Capsule": [1, 1], "Cone": [1, 1], "Cylinder": [1, 1],
        "Halfspace": [[0, 0, 1], 0.0], "Plane": [[0, 0, 1], 0.0], "TriangleP": [*E3],
        "CollisionObject": [api.Sphere(1), transform()], transform.__name__: [E3, [0, 0, 0]],
        "Convex": [CORNERS, 1, [3, 0, 1, 2]] if api is fcl_api else [CORNERS, ()],
    }  # fmt: skip
    if api is coal_api:
        made |= {
            "Quaternion": [1, 0, 0, 0], "AngleAxis": [1.0, [0, 0, 1]], "Triangle": [0, 1, 2],
            "AABB": [[0, 0, 0], [1, 1, 1]],
            "HeightFieldAABB": [1.0, 1.0, np.eye(2)], "OcTree": [0.1], "ContactPatchRequest": [1, 12, 1e-3],
            "CollisionRequest": [coal_api.CollisionRequestFlag.CONTACT, 1],
        }  # fmt: skip
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
    counts, wrong = {"taken": 0, "refused": 0}, []
    for what, call in calls(api, name):
        for label, bad in BAD.items():
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    call(bad)
                counts["taken"] += 1
            except (CollideError, TypeError):
                counts["refused"] += 1
            except Exception as error:  # noqa: BLE001 - that is what is looked for
                wrong.append(f"{api.__name__}.{what} {label}: {type(error).__name__}: {str(error)[:100]}")
    assert not wrong, "\n".join(wrong)
    assert counts["refused"] > counts["taken"], counts


@pytest.mark.parametrize("api", [coal_api, fcl_api])
@pytest.mark.parametrize("bad", [NAN, 10**400])
def test_poses_that_are_no_numbers_are_refused_by_the_query(api, bad):
    transform = api.Transform3s if api is coal_api else api.Transform
    objects = [api.CollisionObject(api.Sphere(1.0), transform(E3, [x, 0, 0])) for x in (0.0, bad)]
    for ask, request, result in ((api.collide, api.CollisionRequest, api.CollisionResult),
                                 (api.distance, api.DistanceRequest, api.DistanceResult)):  # fmt: skip
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
    ):  # fmt: skip
        with pytest.raises(error) as caught:
            call()
        assert all(word in str(caught.value) for word in words), caught.value
