"""What is no shape, pose, question or body is refused, by a message that names thing, field and value."""

from __future__ import annotations

import copy
import math
import pickle
import warnings
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

import collide
from collide import (
    Box,
    Capsule,
    CollideError,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HeightField,
    HPolytope,
    InvalidArgument,
    InvalidPose,
    InvalidShape,
    Mesh,
    Sphere,
    UnknownBody,
    World,
    distance,
    pose,
)
from collide import collide as meets

EYE = np.eye(4)
NAN, INF = math.nan, math.inf
CUBE = np.array([*np.eye(3), *-np.eye(3)])
TRIANGLE = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]


# --- shapes -----------------------------------------------------------------------------------------

BAD_SHAPES = [
    # (what is made, what the message must hold)
    (lambda: Sphere(NAN), ("Sphere", "radius", "nan")),
    (lambda: Sphere(INF), ("Sphere", "radius", "inf")),
    (lambda: Sphere(-1.0), ("Sphere", "radius", "-1.0")),
    (lambda: Sphere(0.0), ("Sphere", "radius", "0.0")),
    (lambda: Sphere("wide"), ("Sphere", "radius", "wide")),
    (lambda: Sphere(None), ("Sphere", "radius", "None")),
    (lambda: Sphere(1e60), ("Sphere", "radius", "1e+60", "scale")),
    (lambda: Sphere(1e-60), ("Sphere", "radius", "1e-60", "scale")),
    (lambda: Sphere(5e-324), ("Sphere", "radius", "5e-324")),
    (lambda: Box((1, 2)), ("Box", "size", "(2,)")),
    (lambda: Box(1.0), ("Box", "size", "()")),
    (lambda: Box([[1, 1, 1]]), ("Box", "size", "(1, 3)")),
    (lambda: Box((1, NAN, 1)), ("Box", "size[1]", "nan")),
    (lambda: Box((1, -2, 1)), ("Box", "size.y", "-2")),
    (lambda: Box((1, 1, -0.5)), ("Box", "size.z", "≥ 0", "-0.5")),
    (lambda: Box((1, 1, 1e60)), ("Box", "size[2]", "1e+60")),
    (lambda: Box((1, 1e-60, 1)), ("Box", "size.y", "1e-60")),
    (lambda: Box("abc"), ("Box", "size", "text")),
    (lambda: Capsule(-0.1, 1.0), ("Capsule", "radius", "-0.1")),
    (lambda: Capsule(0.1, -1.0), ("Capsule", "length", "-1.0")),
    (lambda: Capsule(0.1, NAN), ("Capsule", "length", "nan")),
    (lambda: Cylinder(0.0, 1.0), ("Cylinder", "radius", "0.0")),
    (lambda: Cylinder(1.0, 0.0), ("Cylinder", "length", "0.0")),
    (lambda: Cylinder(1.0, INF), ("Cylinder", "length", "inf")),
    (lambda: Cone(1.0, -2.0), ("Cone", "length", "-2.0")),
    (lambda: Cone(NAN, 2.0), ("Cone", "radius", "nan")),
    (lambda: Ellipsoid((1, 0, 1)), ("Ellipsoid", "radii.y", "0")),
    (lambda: Ellipsoid((1, 1)), ("Ellipsoid", "radii", "(2,)")),
    (lambda: Ellipsoid((1, 1, INF)), ("Ellipsoid", "radii[2]", "inf")),
    (lambda: Halfspace((0, 0, 0), 0.0), ("Halfspace", "normal", "0")),
    (lambda: Halfspace((0, 0, 1e-9), 0.0), ("Halfspace", "normal", "1e-09")),
    (lambda: Halfspace((0, 0, NAN), 0.0), ("Halfspace", "normal[2]", "nan")),
    (lambda: Halfspace((0, 0, 1), INF), ("Halfspace", "offset", "inf")),
    (lambda: Halfspace((0, 0, 1), 1e60), ("Halfspace", "offset", "1e+60")),
    (lambda: ConvexHull([]), ("ConvexHull", "points")),
    (lambda: ConvexHull(np.zeros((0, 3))), ("ConvexHull", "points", "empty")),
    (lambda: ConvexHull(np.zeros((4, 2))), ("ConvexHull", "points", "(4, 2)")),
    (lambda: ConvexHull([[0, 0, 0], [1, 2]]), ("ConvexHull", "points")),
    (lambda: ConvexHull([[0, 0, 0], [1, INF, 0]]), ("ConvexHull", "points[1, 1]", "inf")),
    (lambda: ConvexHull([[0, 0, 1e60]]), ("ConvexHull", "points[0, 2]", "1e+60")),
    (lambda: ConvexHull([[0, 0, 0]], radius=-1.0), ("ConvexHull", "radius", "-1.0")),
    (lambda: ConvexHull(TRIANGLE, faces=[[0, 1, 3]]), ("ConvexHull", "faces[0]", "[0, 1, 3]", "3 points")),
    (lambda: ConvexHull(TRIANGLE, faces=[[0, 1, -1]]), ("ConvexHull", "faces[0]", "-1")),
    (lambda: ConvexHull(TRIANGLE, faces=[[0.0, 1.0, 2.0]]), ("ConvexHull", "faces", "float64")),
    (lambda: ConvexHull(TRIANGLE, faces=[[0, 1], [0, 1, 2]]), ("ConvexHull", "faces")),
    (lambda: HPolytope(CUBE, [1, 1, 1]), ("HPolytope", "offsets", "(3,)")),
    (lambda: HPolytope([[0, 0, 0]], [1]), ("HPolytope", "normals[0]", "zero")),
    (lambda: HPolytope(CUBE[:5], np.ones(5)), ("HPolytope", "unbounded", "0, -1")),
    (lambda: HPolytope(CUBE[:3], np.ones(3)), ("HPolytope", "unbounded")),
    (lambda: HPolytope(CUBE, [1, 1, 1, -2, 1, 1]), ("HPolytope", "empty")),
    (lambda: HPolytope(CUBE, [1, 1, NAN, 1, 1, 1]), ("HPolytope", "offsets[2]", "nan")),
    (lambda: HPolytope(np.zeros((0, 3)), []), ("HPolytope", "normals", "empty")),
    (lambda: Compound([]), ("Compound", "items", "empty")),
    (lambda: Compound([Sphere(1)]), ("Compound", "items")),
    (lambda: Compound([("ball", EYE)]), ("Compound", "items[0]", "str")),
    (lambda: Compound(7), ("Compound", "items")),
]


@pytest.mark.parametrize(("make", "words"), BAD_SHAPES, ids=[" ".join(words) for _, words in BAD_SHAPES])
def test_what_is_no_shape_is_refused(make, words):
    with pytest.raises(InvalidShape) as caught:
        make()
    assert isinstance(caught.value, CollideError) and isinstance(caught.value, ValueError)
    for word in words:
        assert word in str(caught.value), str(caught.value)


@pytest.mark.parametrize("X", [np.diag([1.0, 1, -1, 1]), np.full((4, 4), NAN), np.zeros((2, 4, 4)) + EYE, np.eye(3)])
def test_a_compound_checks_the_poses_of_its_parts(X):
    with pytest.raises(InvalidPose, match=r"Compound: items\[1\]"):
        Compound([(Sphere(1), EYE), (Sphere(1), X)])


# --- poses ------------------------------------------------------------------------------------------


def with_entry(k, m, value):
    X = np.eye(4)
    X[k, m] = value
    return X


BAD_POSES = {
    "nan": (with_entry(0, 3, NAN), "finite"),
    "inf": (with_entry(1, 1, INF), "finite"),
    "mirrored": (np.diag([-1.0, 1, 1, 1]), "mirrors"),
    "mirrored thrice": (np.diag([-1.0, -1, -1, 1]), "mirrors"),
    "sheared": (with_entry(0, 1, 0.1), "not a rotation"),
    "slightly sheared": (with_entry(0, 1, 2e-4), "not a rotation"),
    "scaled": (np.diag([2.0, 2, 2, 1]), "not a rotation"),
    "zero": (np.diag([0.0, 0, 0, 1]), "not a rotation"),
    "last row": (with_entry(3, 0, 1.0), "last|row"),
    "last corner": (with_entry(3, 3, 2.0), "row"),
    "huge": (with_entry(2, 3, 1e60), "1e\\+50"),
    "3x3": (np.eye(3), r"\(3, 3\)"),
    "4x3": (np.eye(4)[:, :3], r"\(4, 3\)"),
    "7": (np.eye(7)[0], r"collide\.poses\("),
    "vector": (np.zeros(3), r"\(3,\)"),
    "text": ("here", "here"),
    "tuple of three": ((np.eye(3), np.zeros(3), 1), "3 items"),
    "tuple of wrong shapes": ((np.eye(3), np.zeros(2)), r"\(2,\)"),
    "tuple of wrong batches": ((np.zeros((2, 3, 3)) + np.eye(3), np.zeros((3, 3))), "do not match"),
}


@pytest.mark.parametrize("name", BAD_POSES)
def test_what_is_no_pose_is_refused(name):
    X, words = BAD_POSES[name]
    for query in (distance, meets):
        with pytest.raises(InvalidPose, match=words) as caught:
            query(Sphere(1), Sphere(1), EYE, X)
        assert "X_WB" in str(caught.value)
        with pytest.raises(InvalidPose, match="X_WA"):
            query(Sphere(1), Sphere(1), X, EYE)
    world = World()
    with pytest.raises(InvalidPose, match=r"World.add: X_WB"):
        world.add(Sphere(1), X)
    world.add(Sphere(1), name="ball")
    with pytest.raises(InvalidPose, match=r"World.set_pose: X_WB"):
        world.set_pose("ball", X)
    with pytest.raises(InvalidPose, match=r"World.query: X_WS"):
        world.query(Sphere(1), X)
    assert len(world) == 1 and np.array_equal(world.body("ball").X_WB, EYE)


def test_the_bad_pose_of_a_batch_is_named():
    Xs = np.array([EYE, EYE, with_entry(0, 3, NAN)])
    with pytest.raises(InvalidPose, match=r"X_WB\[2\]"):
        distance(Sphere(1), Sphere(1), EYE, Xs)


def test_checks_of_rotations_can_be_skipped_but_not_those_of_numbers():
    sheared = with_entry(0, 1, 0.1)
    r = distance(Box((1, 1, 1)), Box((1, 1, 1)), EYE, sheared @ pose((3, 0, 0)), check_poses=False)
    assert r.distance == pytest.approx(1.95)
    with pytest.raises(InvalidPose, match="finite"):
        meets(Sphere(1), Sphere(1), EYE, with_entry(0, 3, NAN), check_poses=False)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"xyz": (0, 0)}, "xyz"),
        ({"xyz": (0, 0, NAN)}, "xyz"),
        ({"rpy": (0, 0, INF)}, "rpy"),
        ({"quat_wxyz": (0, 0, 0, 0)}, "quaternion"),
        ({"quat_wxyz": (1, 0, 0)}, "quat_wxyz"),
        ({"R": np.eye(4)}, "R"),
        ({"R": -np.eye(3)}, "mirrors"),
        ({"rpy": (0, 0, 0), "R": np.eye(3)}, "at most one"),
        ({"xyz": "up"}, "xyz"),
    ],
)
def test_pose_refuses_what_it_cannot_place(arguments, words):
    with pytest.raises(InvalidPose, match=words):
        pose(**arguments)


# --- numbers that are none ---------------------------------------------------------------------------


def nested(depth: int):
    value = 1.0
    for _ in range(depth):
        value = [value]
    return value


#: What is no real number, or not a finite one.
NO_NUMBERS = {
    "beyond doubles": 10**400, "below doubles": -(10**400), "too long to print": 10**5000,
    "fraction": Fraction(10**400),
    "decimal": Decimal("1e400"), "text": "1.0", "bytes": b"1", "complex": 1 + 0j, "numpy complex": np.complex128(1),
    "None": None,
    "time": np.timedelta64(1, "s"), "date": np.datetime64("2020-01-01"), "masked": np.ma.masked, "list": [1.0, 2.0],
    "array": np.ones(2), "nan": NAN, "object": object(), "deep": nested(2000), "numpy text": np.str_("1"),
}
#: Everything that takes one number.
NUMBER_TAKERS = {
    "Sphere": Sphere, "Capsule radius": lambda v: Capsule(v, 1), "Capsule length": lambda v: Capsule(1, v),
    "Cylinder height": lambda v: Cylinder(1, height=v), "Cone": lambda v: Cone(v, 1), "Box": lambda v: Box(1, v, 1),
    "Box of three": lambda v: Box((1, 1, v)), "Ellipsoid": lambda v: Ellipsoid(1, 1, v),
    "Halfspace": lambda v: Halfspace((0, 0, 1), v),
    "Halfspace normal": lambda v: Halfspace((0, v, 1), 0), "ConvexHull": lambda v: ConvexHull([[0, 0, v]]),
    "ConvexHull radius": lambda v: ConvexHull([[0, 0, 0]], radius=v),
    "HPolytope": lambda v: HPolytope(CUBE, [1, 1, 1, 1, 1, v]),
    "HeightField": lambda v: HeightField([[0, 0], [0, v]], 1), "HeightField cell": lambda v: HeightField(EYE, (v, 1)),
    "Mesh": lambda v: Mesh([[0, 0, 0], [1, 0, 0], [0, v, 0]], [[0, 1, 2]]),
    "Mesh.scaled": lambda v: triangle().scaled(v),
    "pose": lambda v: pose((0, 0, v)), "rpy": lambda v: pose(rpy=(0, v, 0)),
    "quaternion": lambda v: pose(quat_wxyz=(1, v, 0, 0)),
    "R": lambda v: pose(R=[[1, 0, 0], [0, 1, 0], [0, v, 1]]),
    "a pose": lambda v: meets(Sphere(1), Sphere(1), EYE, [*EYE.tolist()[:3], [0, 0, v, 1]]),
    "(R, t)": lambda v: meets(Sphere(1), Sphere(1), EYE, (np.eye(3), [0, v, 0])),
    "max_distance": lambda v: distance(Sphere(1), Sphere(1), EYE, EYE, max_distance=v),
    "security_margin": lambda v: meets(Sphere(1), Sphere(1), EYE, EYE, security_margin=v),
    "margin": lambda v: collide.contacts(Sphere(1), Sphere(1), EYE, EYE, margin=v),
    "max_contacts": lambda v: collide.contacts(Sphere(1), Sphere(1), EYE, EYE, max_contacts=v),
    "threads": lambda v: meets(Sphere(1), Sphere(1), EYE, EYE, threads=v),
    "threads of distance": lambda v: distance(Sphere(1), Sphere(1), EYE, EYE, threads=v),
    "contains": lambda v: collide.contains(Sphere(1), EYE, (0, v, 0)),
    "raycast origin": lambda v: collide.raycast(Box(1, 1, 1), EYE, (0, v, 0), (0, 0, 1)),
    "raycast limit": lambda v: collide.raycast(Box(1, 1, 1), EYE, (0, 0, 0), (0, 0, 1), max_distance=v),
    "World.add": lambda v: World().add(Sphere(1), (np.eye(3), (v, 0, 0))),
    "World.distances": lambda v: world_of_three().distances(v),
    "World.query": lambda v: world_of_three().query(Sphere(1), EYE, v),
    "World.remove": lambda v: world_of_three().remove(v),
    "World.contacts": lambda v: world_of_three().contacts(v),
    "Compound": lambda v: Compound([(Sphere(1), (np.eye(3), (v, 0, 0)))]),
}
#: Whole numbers of any size are as good here.
WHOLE = {("threads", "beyond doubles"), ("threads", "too long to print"), ("threads of distance", "beyond doubles"),
         ("threads of distance", "too long to print"), ("max_contacts", "beyond doubles"),
         ("max_contacts", "too long to print")}


def triangle():
    return Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


@pytest.mark.parametrize("taker", NUMBER_TAKERS)
def test_what_is_no_number_is_refused_wherever_it_is_given(taker):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "Warning: converting a masked element to nan")
        for name, value in NO_NUMBERS.items():
            if (taker, name) in WHOLE:
                continue
            try:
                made = NUMBER_TAKERS[taker](value)
            except CollideError as error:
                assert len(str(error)) < 600, (name, str(error)[:900])
                continue
            pytest.fail(f"{taker} took {name}: {made!r}")


def test_numbers_of_every_kind_are_taken():
    wanted = Box(1, 0.5, 0.25)
    for value in (
        Fraction(1, 2),
        Decimal("0.5"),
        np.float32(0.5),
        np.float16(0.5),
        np.longdouble(0.5),
        np.array(0.5),
        0.5,
    ):
        assert Box(1, value, 0.25) == Box((1, value, 0.25)) == wanted and Sphere(value) == Sphere(0.5)
    assert Sphere(True) == Sphere(np.int8(1)) == Sphere(np.uint64(1)) == Sphere(1.0)
    assert Box(np.ma.array([1, 0.5, 0.25], mask=False)) == wanted
    assert Box(np.array([1, Fraction(1, 2), 0.25], dtype=object)) == wanted


RAGGED = [[1, 2], [3]]
NO_ARRAYS = {
    "ragged": (RAGGED, "lengths"), "masked": (np.ma.array(np.eye(3), mask=np.eye(3)), "masked"),
    "masked rows": ([np.ma.array([0.0, 0, 0], mask=[1, 0, 0])], "masked"), "text": ([["0", "0", "1"]], "text"),
    "complex": (np.eye(3) * 1j, "complex"), "times": (np.eye(3).astype("m8[s]"), "time spans"),
    "deep": (nested(2000), "lengths"),
    "None": ([[0, 0, None]], "None"), "a dictionary": ({"x": 1}, "x"),
    "records": (np.zeros(3, dtype=[("x", "f8")]), "records"),
}


@pytest.mark.parametrize("name", NO_ARRAYS)
def test_what_is_no_array_of_numbers_is_refused_wherever_it_is_given(name):
    value, words = NO_ARRAYS[name]
    for take in (
        ConvexHull, lambda v: HPolytope(v, [1]), lambda v: Mesh(v, [[0, 1, 2]]), Box, Ellipsoid,
        lambda v: HeightField(v, 1),
        lambda v: Halfspace(v, 0),
        lambda v: pose(R=v), lambda v: meets(Sphere(1), Sphere(1), v, EYE),
        lambda v: meets(Sphere(1), Sphere(1), EYE, (v, np.zeros(3))),
        lambda v: collide.contains(triangle(), EYE, v), lambda v: collide.raycast(triangle(), EYE, v, (0, 0, 1)),
        lambda v: collide.raycast(triangle(), EYE, (0, 0, 1), v),
        lambda v: collide.contacts(Sphere(1), Sphere(1), EYE, v),
        lambda v: World().add(Sphere(1), v), lambda v: collide.raycast(triangle(), v, (0, 0, 0), (0, 0, 1)),
    ):
        with warnings.catch_warnings(), pytest.raises(CollideError, match=words):
            warnings.simplefilter("error")
            take(value)


@pytest.mark.parametrize(
    "faces",
    [
        RAGGED, np.ones((1, 3), "m8[s]"), np.ma.array([[0, 1, 2]], mask=[[1, 0, 0]]), [["0", "1", "2"]],
        np.array([[0, 1, 2 + 0j]]), [[0, 1, 10**30]], nested(2000), [[0, 1, None]], [[True, False, True]],
    ],
    ids=range(9),
)
def test_faces_are_rows_of_integers(faces):
    for make in (lambda: Mesh(np.eye(3), faces), lambda: ConvexHull(np.eye(3), faces=faces)):
        with pytest.raises(InvalidShape, match="faces"):
            make()


def test_values_are_shown_as_numbers_and_short():
    with pytest.raises(InvalidShape, match=r"size\.y must be ≥ 0, got -1\.0$"):
        Box(np.array([1.0, -1.0, 1.0]))
    for call in (
        lambda: Sphere("x" * 10**6),
        lambda: meets("x" * 10**6, Sphere(1), EYE, EYE),
        lambda: World().add("x" * 10**6),
    ):
        with pytest.raises(CollideError) as caught:
            call()
        assert len(str(caught.value)) < 400


def test_sizes_and_lengths_by_either_name():
    assert Box(1, 2, 3) == Box((1, 2, 3)) == Box(size=[1, 2, 3]) and Ellipsoid(1, 2, 3) == Ellipsoid((1, 2, 3))
    for kind in (Cylinder, Cone, Capsule):
        assert kind(0.1, height=0.5) == kind(0.1, 0.5) == kind(radius=0.1, length=0.5)
        for arguments in ({}, {"length": 1.0, "height": 1.0}):
            with pytest.raises(InvalidShape, match=f"{kind.__name__}: give one of length and height"):
                kind(0.1, **arguments)
    with pytest.raises(InvalidShape, match="Box: size must be three lengths"):
        Box(1, 2)


class Carrier:
    """What a trimesh.Trimesh looks like from outside."""

    vertices, faces = np.eye(3), np.array([[0, 1, 2]])


def test_a_mesh_of_an_object_that_has_vertices_and_faces():
    assert Mesh(Carrier()) == Mesh(np.eye(3), [[0, 1, 2]]) and Mesh(Carrier(), solid=False).solid is False
    for other in (np.eye(3), "part.stl", None):
        with pytest.raises(InvalidShape, match=r"vertices .* and faces"):
            Mesh(other)


# --- queries ----------------------------------------------------------------------------------------


def test_batches_must_match():
    two, three = np.array([EYE] * 2), np.array([EYE] * 3)
    for query in (distance, meets):
        with pytest.raises(InvalidArgument, match="X_WA 2, X_WB 3"):
            query(Sphere(1), Sphere(1), two, three)


def test_empty_batches_have_empty_answers():
    none = np.zeros((0, 4, 4))
    for X, Y in ((none, EYE), (EYE, none), (none, none)):
        assert len(distance(Sphere(1), Box((1, 1, 1)), X, Y)) == 0
        assert meets(Sphere(1), Compound([(Sphere(1), EYE), (Sphere(2), EYE)]), X, Y).shape == (0,)


@pytest.mark.parametrize("shape", [None, 1.0, "sphere", Sphere, EYE])
def test_queries_ask_for_shapes(shape):
    for query in (distance, meets):
        with pytest.raises(InvalidArgument, match="A must be a shape"):
            query(shape, Sphere(1), EYE, EYE)
        with pytest.raises(InvalidArgument, match="B must be a shape"):
            query(Sphere(1), shape, EYE, EYE)


@pytest.mark.parametrize("limit", [-1.0, NAN, "far", None, [1, 2]])
def test_limits_are_numbers_from_zero_on(limit):
    world = World()
    world.add(Sphere(1))
    with pytest.raises(InvalidArgument, match="max_distance"):
        distance(Sphere(1), Sphere(1), EYE, EYE, max_distance=limit)
    with pytest.raises(InvalidArgument, match=r"World.distances: max_distance"):
        world.distances(max_distance=limit)
    with pytest.raises(InvalidArgument, match=r"World.query: max_distance"):
        world.query(Sphere(1), EYE, max_distance=limit)


def test_fields_that_a_result_does_not_have():
    r = distance(Sphere(1), Sphere(1), EYE, EYE)
    with pytest.raises(AttributeError, match="no field 'depth'"):
        _ = r.depth
    assert "distance" in dir(r)


# --- worlds -----------------------------------------------------------------------------------------


def world_of_three() -> World:
    world = World()
    for name in ("a", "b", "c"):
        world.add(Sphere(1), name=name)
    return world


def test_names_are_unique_and_not_empty():
    world = world_of_three()
    with pytest.raises(InvalidArgument, match='"a" already'):
        world.add(Sphere(1), name="a")
    for name in ("", 7, b"a"):
        with pytest.raises(InvalidArgument, match="name"):
            world.add(Sphere(1), name=name)
    assert len(world) == 3


@pytest.mark.parametrize("who", ["z", 99, -1, None, 1.5j, 1.9, 1.0, INF, True, 10**400, [1]])
def test_unknown_bodies(who):
    world = world_of_three()
    for ask in (
        lambda: world.remove(who),
        lambda: world.body(who),
        lambda: world.set_pose(who, EYE),
        lambda: world.set_poses([who], EYE),
        lambda: world.allow("a", who if who is not None else "z"),
    ):
        with pytest.raises(UnknownBody) as caught:
            ask()
        assert isinstance(caught.value, LookupError)
        assert "a, b, c" in str(caught.value) or "id" in str(caught.value)


def test_a_removed_body_is_unknown():
    world = world_of_three()
    world.remove("b")
    with pytest.raises(UnknownBody, match="body: no body is named 'b'"):
        world.remove("b")
    with pytest.raises(UnknownBody, match="removed"):
        world.body(1)


@pytest.mark.parametrize("field", ["group", "mask"])
@pytest.mark.parametrize("value", [-1, 2**32, 1.0, True, "1", None])
def test_groups_and_masks_are_bits(field, value):
    with pytest.raises(InvalidArgument, match=field):
        World().add(Sphere(1), **{field: value})


def test_other_arguments_of_a_world():
    world = world_of_three()
    for static in (np.ones(2), "yes", None):
        with pytest.raises(InvalidArgument, match=r"World\.add: static"):
            world.add(Sphere(1), static=static)
    with pytest.raises(InvalidArgument, match=r"World\.allow: a must be .*\(bodies, bodies\)"):
        world.allow(RAGGED)
    with pytest.raises(InvalidArgument, match=r"World.add: shape"):
        world.add("ball")
    with pytest.raises(InvalidArgument, match=r"World.query: shape"):
        world.query(3, EYE)
    with pytest.raises(InvalidArgument, match="a and b are the same body"):
        world.allow("a", "a")
    with pytest.raises(InvalidPose, match=r"2 bodies .* are 3 poses"):
        world.set_poses(["a", "b"], [EYE] * 3)
    with pytest.raises(InvalidPose, match="one"):
        world.add(Sphere(1), [EYE] * 2)


@pytest.mark.parametrize(
    "matrix", [np.ones((2, 2), bool), np.ones((3, 3)), np.triu(np.ones((3, 3), bool)), np.ones(3, bool)]
)
def test_allowing_matrices_are_square_boolean_symmetric(matrix):
    with pytest.raises(InvalidArgument, match="must be a symmetric boolean matrix, "):
        world_of_three().allow(matrix)


def test_set_poses_with_an_unknown_body_moves_none():
    world = world_of_three()
    with pytest.raises(UnknownBody):
        world.set_poses(["a", "nobody"], [pose((1, 0, 0)), EYE])
    assert np.array_equal(world.body("a").X_WB, EYE)
    with pytest.raises(InvalidPose):
        world.set_poses(["a", "b"], [pose((1, 0, 0)), with_entry(0, 3, NAN)])
    assert np.array_equal(world.body("a").X_WB, EYE)


def test_every_error_is_a_collide_error():
    for name in collide.__all__:
        member = getattr(collide, name)
        if isinstance(member, type) and issubclass(member, Exception):
            assert issubclass(member, CollideError)


def test_a_copy_of_a_world_is_its_own():
    """Removing from one leaves the other as it was, and neither reads tables of the other's."""
    world = world_of_three()
    expected = len(world.distances())
    for other in (copy.copy(world), copy.deepcopy(world), pickle.loads(pickle.dumps(world))):
        other.remove("a")
        assert (
            len(other) == 2
            and len(world) == 3
            and len(other.distances()) == 1
            and len(world.distances()) == expected == 3
        )
    other = copy.deepcopy(world)
    del world
    assert other.collides() and len(other.collisions()) == 3


def test_numbers_are_read_while_another_thread_imports_numpys_masks(monkeypatch):
    """Half of a module is there at such a moment. Met where two threads made their first calls."""
    import sys
    import types

    from collide.base import argument_checks as checks

    monkeypatch.setitem(sys.modules, "numpy.ma", types.ModuleType("numpy.ma"))
    assert checks.number(0.5) == 0.5
    assert collide.Box((1, 2, 3)).size.tolist() == [1.0, 2.0, 3.0]
    assert collide.pose((1, 2, 3))[:3, 3].tolist() == [1.0, 2.0, 3.0]
