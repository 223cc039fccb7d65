"""What python-fcl and trimesh's CollisionManager are expected to do, as their documents and interfaces say.

Every function here holds for python-fcl itself and for its stand-in: `tests/adapters/test_fcl_expectations.py` calls
them with both.
"""

from __future__ import annotations

import sys

import numpy as np

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
PYRAMID = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
PYRAMID_FACETS = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
#: The z axis onto −y.
LYING = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def close(value, truth, tolerance=2e-6) -> None:
    assert abs(value - truth) < tolerance, (value, truth)


def bodies(fcl) -> dict:
    mesh = fcl.BVHModel()
    mesh.beginModel(len(PYRAMID), len(PYRAMID_FACETS))
    mesh.addSubModel(PYRAMID, PYRAMID_FACETS)
    mesh.endModel()
    faces = np.array([[4, *quad] for quad in QUADS]).flatten()
    shapes = {
        "box": fcl.Box(1.0, 1.0, 1.0), "ball": fcl.Sphere(1.0), "cone": fcl.Cone(1.0, 1.0),
        "cylinder": fcl.Cylinder(1.0, 1.0), "mesh": mesh, "hull": fcl.Convex(CORNERS, 6, faces),
    }
    return {name: fcl.CollisionObject(shape) for name, shape in shapes.items()}


def pairs_collide(fcl) -> None:
    """Names of arguments, counts, flags; a mesh is its facets."""
    of = bodies(fcl)
    request = fcl.CollisionRequest(num_max_contacts=100, enable_contact=True)

    def asked(a, b):
        result = fcl.CollisionResult()
        n = fcl.collide(o1=of[a], o2=of[b], request=request, result=result)
        assert isinstance(n, int) and n == len(result.contacts) and result.is_collision == (n > 0), (a, b)
        assert result.cost_sources == []
        for contact in result.contacts:
            assert contact.normal.shape == contact.pos.shape == (3,) and contact.penetration_depth >= 0.0
            close(np.linalg.norm(contact.normal), 1.0)
        return n > 0

    assert all(asked(*pair) for pair in (("box", "cone"), ("hull", "cone"), ("box", "mesh"), ("cone", "mesh")))
    of["cone"].setTranslation(np.array([0.0, 0.0, -0.6]))  # its tip at z = −0.1, below the mesh
    assert asked("box", "cone") and asked("hull", "cone") and not asked("cone", "mesh")
    of["cone"].setRotation(LYING)
    of["cone"].setTranslation(np.array([0.0, -1.1, 0.0]))
    assert not asked("box", "cone") and not asked("hull", "cone")
    of["cone"].setTranslation(np.array([0.0, -0.9, 0.0]))
    assert asked("box", "cone") and asked("hull", "cone")


def distances(fcl) -> None:
    """Signed where that is wanted, −1 where not; nearest points; a box and the hull of its corners are alike."""
    of = bodies(fcl)
    signed = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)
    assert fcl.distance(of["box"], of["cone"], signed, fcl.DistanceResult()) < 0.0
    assert fcl.distance(of["box"], of["cone"]) == -1.0
    assert fcl.distance(of["box"], of["mesh"], signed) < 0.0
    of["cone"].setTranslation(np.array([0.0, 0.0, -0.6]))
    close(fcl.distance(of["cone"], of["mesh"], signed), 0.1)
    of["cone"].setRotation(LYING)
    of["cone"].setTranslation(np.array([0.0, -1.1, 0.0]))
    for name in ("box", "hull"):
        result = fcl.DistanceResult()
        gap = fcl.distance(o1=of[name], o2=of["cone"], request=signed, result=result)
        close(gap, 0.1)
        assert result.min_distance == gap and [len(point) for point in result.nearest_points] == [3, 3]
        close(np.linalg.norm(result.nearest_points[0] - result.nearest_points[1]), gap)
        again = fcl.distance(of["box"], of["ball"], signed, result)  # which meet, and so is nearer
        assert again < 0.0 and result.min_distance == again
    of["ball"].setTranslation(np.array([9.0, 0.0, 0.0]))
    far = fcl.distance(of["box"], of["ball"], signed, result)
    close(far, 7.5)
    assert result.min_distance == again < far  # the least of all calls stays
    assert fcl.DistanceResult().min_distance == sys.float_info.max


def poses(fcl) -> None:
    """Quaternions are w, x, y, z; what getters give is a copy."""
    half = np.sqrt(0.5)
    tf = fcl.Transform(np.array([half, 0.0, 0.0, half]), np.array([1.0, 2.0, 3.0]))
    assert np.allclose(tf.getRotation(), [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    obj = fcl.CollisionObject(fcl.Box(1.0, 2.0, 3.0), tf)
    assert np.allclose(obj.getQuatRotation(), [half, 0, 0, half]) and np.allclose(obj.getTranslation(), [1, 2, 3])
    obj.getTranslation()[:] = 7.0
    assert np.allclose(obj.getTranslation(), [1, 2, 3])
    obj.setTransform(fcl.Transform())
    obj.setQuatRotation(np.array([half, half, 0.0, 0.0]))
    assert np.allclose(obj.getTransform().getRotation(), [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    tf.setTranslation(np.array([0.0, 0.0, 0.0]))
    assert np.allclose(obj.getTranslation(), 0.0)  # poses are copied
    assert obj.getObjectType() == fcl.OBJECT_TYPE.OT_GEOM and obj.getNodeType() == fcl.NODE_TYPE.GEOM_BOX
    assert obj.isOccupied() and not obj.isFree() and not obj.isUncertain()


def geometries(fcl) -> None:
    """Fields as they were given, full lengths."""
    assert fcl.Box(1.0, 2.0, 3.0).side.tolist() == [1.0, 2.0, 3.0]
    assert fcl.Ellipsoid(1.0, 2.0, 3.0).radii.tolist() == [1.0, 2.0, 3.0]
    for kind in (fcl.Capsule, fcl.Cone, fcl.Cylinder):
        shape = kind(0.5, 2.0)
        assert (shape.radius, shape.lz) == (0.5, 2.0)
        shape.lz = 3.0
        assert shape.lz == 3.0
    plane = fcl.Plane(np.array([0.0, 0.0, 2.0]), 3.0)
    assert plane.n.tolist() == [0.0, 0.0, 1.0] and plane.d == 1.5
    assert fcl.Convex(CORNERS, 6, np.array([[4, *quad] for quad in QUADS]).flatten()).num_faces == 6
    assert fcl.BVHModel().buildState() == 0 and fcl.CollisionGeometry().getNodeType() is None
    # a capsule's length is that of its axis, a cone's tip is at +lz/2
    ball = fcl.CollisionObject(fcl.Sphere(0.5), fcl.Transform(np.array([0.0, 0.0, 3.0])))
    close(fcl.distance(fcl.CollisionObject(fcl.Capsule(0.5, 2.0)), ball), 1.0)
    close(fcl.distance(fcl.CollisionObject(fcl.Cone(0.5, 2.0)), ball), 1.5)


def managers_collide(fcl) -> None:
    """One with all, all with all, one manager with another; an object that moved, after update."""
    def manager_of(*placed):
        shapes = {name: obj for name, obj in bodies(fcl).items()}
        objects = []
        for name, z in placed:
            shapes[name].setTranslation(np.array([0.0, 0.0, z]))
            objects.append(shapes[name])
        manager = fcl.DynamicAABBTreeCollisionManager()
        manager.registerObjects(objects)
        manager.setup()
        assert len(manager.getObjects()) == manager.size() == len(placed) and not manager.empty()
        return manager, objects

    near, near_objects = manager_of(("box", 0.0), ("cylinder", 0.0))
    far, _ = manager_of(("cone", 5.0), ("cylinder", -5.0))
    third, _ = manager_of(("mesh", 0.0), ("hull", -5.0))

    def meets(manager, *who):
        cdata = fcl.CollisionData(fcl.CollisionRequest(100, True), fcl.CollisionResult())
        manager.collide(*who, cdata, fcl.defaultCollisionCallback)
        return cdata.result.is_collision

    guest = bodies(fcl)["cylinder"]
    guest.setTranslation(np.array([0.0, 0.0, -4.6]))
    assert meets(near, bodies(fcl)["box"]) and not meets(near, guest)
    assert not meets(far, bodies(fcl)["box"]) and meets(far, guest)
    assert meets(near) and not meets(far)
    assert not meets(near, far) and meets(far, third) and meets(near, third)
    near_objects[0].setTranslation(np.array([50.0, 0.0, 0.0]))
    for argument in ((near_objects[0],), ([near_objects[0]],), ()):
        near.update(*argument)
        assert not meets(near)
    near_objects[0].setTranslation(np.array([0.5, 0.0, 0.0]))
    near.update(near_objects[0])
    assert meets(near)
    near.unregisterObject(near_objects[0])
    assert not meets(near) and near.size() == 1
    near.unregisterObject("no object of it")  # nothing happens


def managers_measure(fcl) -> None:
    """Least distances, and points that are so far apart, whichever came first."""
    def balls(*places):
        manager = fcl.DynamicAABBTreeCollisionManager()
        manager.registerObjects([fcl.CollisionObject(fcl.Sphere(0.5), fcl.Transform(np.array(p))) for p in places])
        manager.setup()
        return manager

    def least(manager, *who):
        cdata = fcl.DistanceData(request=fcl.DistanceRequest(enable_nearest_points=True))
        manager.distance(*who, cdata, fcl.defaultDistanceCallback)
        result = cdata.result
        close(np.linalg.norm(np.subtract(*result.nearest_points)), max(result.min_distance, 0.0))
        return result.min_distance

    line = balls([0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [7.0, 0.0, 0.0])
    close(least(line), 2.0)
    close(least(line, fcl.CollisionObject(fcl.Sphere(0.5), fcl.Transform(np.array([0.0, 6.0, 0.0])))), 5.0)
    close(least(line, balls([0.0, 9.0, 0.0], [7.0, 0.0, 2.5])), 1.5)
    close(least(line, balls([7.0, 0.0, 2.5], [0.0, 9.0, 0.0])), 1.5)
    boxes = [((20.0, 5.0), (-2.0, 0.0), 0.8660254), ((5.0, 5.0), (-5.0, 10.0), 1.0), ((5.0, 5.0), (-15.0, 15.0), 1.0)]
    objects = []
    for (x, y), place, w in boxes:
        q = np.array([w, 0.0, 0.0, np.sqrt(1.0 - w * w)])
        objects.append(fcl.CollisionObject(fcl.Box(x, y, 1000.0), fcl.Transform(q, [*place, 0.0])))
    found = []
    for order in ((1, 2), (2, 1)):
        one, rest = fcl.DynamicAABBTreeCollisionManager(), fcl.DynamicAABBTreeCollisionManager()
        one.registerObject(objects[0])
        rest.registerObjects([objects[k] for k in order])
        cdata = fcl.DistanceData(fcl.DistanceRequest(True))
        one.distance(rest, cdata, fcl.defaultDistanceCallback)
        close(np.linalg.norm(np.subtract(*cdata.result.nearest_points)), cdata.result.min_distance, 1e-5)
        found.append(cdata.result.min_distance)
    close(*found, 1e-5)


def callbacks(fcl) -> None:
    """They end the traversal by True; distances that they report prune it. Other arguments are a ValueError."""
    manager = fcl.DynamicAABBTreeCollisionManager()
    spheres = [fcl.CollisionObject(fcl.Sphere(1.0), fcl.Transform(np.array([0.1 * k, 0.0, 0.0]))) for k in range(5)]
    manager.registerObjects(spheres)
    manager.setup()
    seen = []
    manager.collide("data", lambda a, b, cdata: seen.append(cdata))
    assert seen == ["data"] * 10
    manager.collide(None, lambda a, b, cdata: seen.append(None) or True)
    assert len(seen) == 11
    cdata = fcl.CollisionData()  # one contact is wanted: the second pair that meets ends it
    manager.collide(cdata, fcl.defaultCollisionCallback)
    assert cdata.done and cdata.result.is_collision and len(cdata.result.contacts) == 2
    assert fcl.defaultCollisionCallback(spheres[0], spheres[1], cdata) is True and len(cdata.result.contacts) == 2
    for wrong in ((None, None), (1, 2, 3), (None,)):
        try:
            manager.collide(*wrong)
            raise AssertionError(wrong)
        except ValueError:
            pass


def motions(fcl) -> None:
    """Bodies at rest that are apart never meet; defaults and names of arguments."""
    of = bodies(fcl)
    of["cone"].setTranslation(np.array([0.0, 0.0, -2.0]))
    result = fcl.ContinuousCollisionResult()
    end = fcl.Transform(np.array([0.0, 0.0, -2.0]))
    request = fcl.ContinuousCollisionRequest()
    assert fcl.continuousCollide(of["box"], fcl.Transform(), of["cone"], end, request, result) == 1.0
    assert not result.is_collide and result.time_of_contact == 1.0
    assert request.ccd_motion_type == fcl.CCDMotionType.CCDM_TRANS and request.num_max_iterations == 10


FCL = (pairs_collide, distances, poses, geometries, managers_collide, managers_measure, callbacks, motions)

# --- trimesh ------------------------------------------------------------------------------------


def moved(x, y=0.0, z=0.0) -> np.ndarray:
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X


def trimesh_collides(trimesh) -> None:
    """Names in pairs, contacts with places and numbers of facets; objects that come, go, move and are replaced."""
    cube, ring = trimesh.creation.box((1, 1, 1)), trimesh.creation.annulus(1.0, 2.0, 1.0)
    manager = trimesh.collision.CollisionManager()
    manager.add_object("a", cube)
    manager.add_object("b", cube, moved(5))
    assert manager.in_collision_single(cube) is True and manager.in_collision_internal() is False
    hit, names, data = manager.in_collision_single(cube, moved(5.25), return_names=True, return_data=True)
    assert hit is True and names == {"b"} and data
    assert all(len(contact.point) == len(contact.normal) == 3 for contact in data)
    assert all(contact.names == {"b", "__external"} and contact.depth >= 0.0 for contact in data)
    hit, names, data = manager.in_collision_single(cube, moved(-5), return_names=True, return_data=True)
    assert hit is False and names == set() and data == []
    manager.add_object("c", cube, moved(5.5))
    assert manager.in_collision_internal(return_names=True) == (True, {("b", "c")})
    manager.set_transform("c", moved(-5))
    assert manager.in_collision_internal() is False
    manager.set_transform("c", moved(0.5))
    hit, names, data = manager.in_collision_internal(return_names=True, return_data=True)
    assert hit and names == {("a", "c")} and all(contact.names == {"a", "c"} for contact in data)
    manager.remove_object("c")
    assert manager.in_collision_internal() is False
    for wrong in (manager.remove_object, lambda name: manager.set_transform(name, np.eye(4))):
        try:
            wrong("c")
            raise AssertionError
        except ValueError as error:
            assert "c not in collision manager" in str(error)
    manager.add_object("ring", ring, moved(0, 9))
    ball = trimesh.creation.icosphere(radius=0.5)
    assert manager.in_collision_single(ball, moved(0, 9)) is False  # within the ring's hole
    hit, names, data = manager.in_collision_single(ring, moved(0, 9, 0.3), return_names=True, return_data=True)
    assert hit and names == {"ring"}
    numbers = [(contact.index("ring"), contact.index("__external")) for contact in data]
    assert all(0 <= i < len(ring.faces) and 0 <= j < len(ring.faces) for i, j in numbers)


def trimesh_of_two_managers(trimesh) -> None:
    cube = trimesh.creation.box((1, 1, 1))
    ring = trimesh.creation.annulus(1.0, 2.0, 1.0)
    mine, theirs = trimesh.collision.CollisionManager(), trimesh.collision.CollisionManager()
    mine.add_object("a", cube)
    mine.add_object("b", ring, moved(5))
    theirs.add_object("x", cube, moved(-5))
    assert mine.in_collision_other(theirs) is False
    theirs.add_object("y", cube, moved(6.5))  # a solid in the wall of the ring, which fcl names first
    theirs.add_object("z", ring, moved(0.5, 1.5))
    hit, names, data = mine.in_collision_other(theirs, return_names=True, return_data=True)
    assert hit and names == {("b", "y"), ("a", "z")} and {frozenset(c.names) for c in data} == {
        frozenset(("b", "y")), frozenset(("a", "z"))
    }
    others = trimesh.collision.CollisionManager()
    others.add_object("far", cube, moved(-3))  # along y or z python-fcl itself says 2.236, not 2
    distance, names, near = mine.min_distance_other(others, return_names=True, return_data=True)
    close(distance, 2.0)
    assert names == ("a", "far")
    close(np.linalg.norm(near.point("a") - near.point("far")), 2.0)


def trimesh_measures(trimesh) -> None:
    cube = trimesh.creation.box((1, 1, 1))
    manager = trimesh.collision.CollisionManager()
    manager.add_object("a", cube, moved(5))
    close(manager.min_distance_single(cube), 4.0)
    close(manager.min_distance_single(cube, moved(5.75)), -0.25)
    distance, name = manager.min_distance_single(cube, return_name=True)
    assert name == "a"
    manager.add_object("b", cube, moved(-5))
    distance, name, data = manager.min_distance_single(cube, moved(-2), return_name=True, return_data=True)
    close(distance, 2.0)
    assert name == "b" and data.names == {"b", "__external"}
    close(np.linalg.norm(data.point("b") - data.point("__external")), 2.0)
    distance, names = manager.min_distance_internal(return_names=True)
    close(distance, 9.0)
    assert names == ("a", "b")
    manager.add_object("c", cube, moved(2))
    distance, names = manager.min_distance_internal(return_names=True)
    close(distance, 2.0)
    assert names == ("a", "c")
    close(manager.min_distance_internal(name="b"), 6.0)
    manager.set_transform("c", moved(-2))
    assert manager.min_distance_internal(return_names=True)[1] == ("b", "c")


def trimesh_scenes(trimesh) -> None:
    scene = trimesh.Scene()
    for k in range(4):
        scene.add_geometry(trimesh.creation.box((1, 1, 1)), node_name=f"node {k}", transform=moved(0.8 * k))
    manager, objects = trimesh.collision.scene_to_collision(scene)
    assert set(objects) == {f"node {k}" for k in range(4)}
    hit, names = manager.in_collision_internal(return_names=True)
    assert hit and names == {(f"node {k}", f"node {k + 1}") for k in range(3)}


TRIMESH = (trimesh_collides, trimesh_of_two_managers, trimesh_measures, trimesh_scenes)
