"""collide.hpp: every class asked by a program in C++, its answers Python's bit by bit; errors, owners, Eigen."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from naive import rng_of
from random_robots import random_configurations, random_robot
from test_c_casts import told as told_of_cast
from test_c_rays import told as told_of_ray

import collide
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

FLAGS = ["-std=c++17", "-O1", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]
EIGEN = next((folder for folder in ("/usr/include/eigen3", "/usr/local/include/eigen3") if Path(folder).is_dir()), None)
#: Memory freed twice, used after or not freed ends a program with a report.
ADDRESSES = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]


def _built(folder: Path, text: str, *options: str) -> Path:
    tool = next((name for name in ("c++", "g++", "clang++") if shutil.which(name)), None)
    if tool is None:
        pytest.skip("no compiler of C++")
    (folder / "program.cpp").write_text(text, encoding="utf-8")
    library = Path(collide.get_library())
    command = [
        tool, *FLAGS, *options, f"-I{collide.get_include()}", "program.cpp", library, f"-Wl,-rpath,{library.parent}",
        "-o", "program",
    ]
    done = subprocess.run([*map(str, command)], cwd=folder, capture_output=True, text=True, check=False, timeout=300)
    if "cannot find" in done.stderr and "san" in done.stderr:
        pytest.skip(f"no sanitizers: {done.stderr.splitlines()[-1]}")
    assert done.returncode == 0, done.stderr
    return folder / "program"


def _run(program: Path) -> bytes:
    done = subprocess.run([program], cwd=program.parent, env={}, capture_output=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout


_ANSWERS = r"""
#include <collide.hpp>
#include <cstdio>
#include <limits>
using namespace collide;

template <class Rows> void put(const Rows &rows) { std::fwrite(rows.data(), sizeof *rows.data(), rows.size(), stdout); }
void put(const collide_pair &row) { std::fwrite(&row, sizeof row, 1, stdout); }

int main() {
    Workspace space;
    std::vector<Shape> shapes;
    shapes.push_back(Shape::sphere(0.3));
    shapes.push_back(Shape::box({0.4, 0.5, 0.6}));
    shapes.push_back(Shape::capsule(0.1, 0.7));
    shapes.push_back(Shape::cylinder(0.2, 0.5));
    shapes.push_back(Shape::cone(0.3, 0.6));
    shapes.push_back(Shape::ellipsoid({0.2, 0.3, 0.4}));
    shapes.push_back(Shape::halfspace({0.0, 0.6, 0.8}, -0.1));
    const double corners[] = {0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5};
    shapes.push_back(Shape::hull(corners, 0.05));
    const std::vector<double> normals = {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1}, offsets(6, 0.25);
    shapes.push_back(Shape::hpolytope(normals, offsets));
    const Pose here, there(std::array<double, 16>{0.8, -0.6, 0, 0.3, 0.6, 0.8, 0, 0.45, 0, 0, 1, 0.25, 0, 0, 0, 1});

    std::vector<std::uint8_t> hits;
    for (const Shape &shape : shapes) {
        hits.push_back(space.collides(shapes[1], shape, here, there));
        put(space.distance(shapes[1], shape, here, there));
        put(space.distance(shapes[1], shape, here, there, 0.01, COLLIDE_UNSIGNED));
    }
    put(hits);

    std::vector<Pose> fall(5);
    for (std::size_t k = 0; k < fall.size(); ++k) fall[k] = Pose::at(0.0, 0.0, 0.45 + 0.05 * double(k));
    put(space.collides_batch(shapes[0], shapes[1], here, fall));
    put(space.distance_batch(shapes[0], shapes[1], here, fall));
    ShapeSet set(shapes);
    const std::vector<std::int64_t> which = {0, 1, 1, 2, 2, 3, 3, 4, 4, 7};
    put(space.collides_each(set, which, fall, here));
    put(space.distance_each(set, which, fall, here));
    put(space.contacts(shapes[1], shapes[8], here, Pose::at(0.1, 0.0, 0.54), 0.01, 8));
    Contacts contacts = space.contacts_batch(shapes[1], shapes[8], here, fall, 0.06, 4);
    put(contacts.rows);
    if (contacts.of(1).size() != 4 || contacts.of(4).size() != 0) return 2;
    put(space.contacts_each(set, which, fall, here, 0.06, 4).rows);

    const std::array<double, 12> vertices = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    const std::int32_t faces[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    Mesh mesh(vertices, faces), block(shapes[1]);
    for (const Pose &pose : {there, fall[0]}) put(std::array<std::uint8_t, 1>{space.collides(mesh, block, here, pose)});
    put(space.distance(mesh, block, here, Pose::at(0.0, 0.0, 2.0)));

    std::vector<double> points;
    for (int k = 0; k < 300; ++k)
        for (int axis = 0; axis < 3; ++axis) points.push_back(k / (axis == 0 ? 1 : axis == 1 ? 7 : 49) % 7 * 0.1);
    Field cloud = Field::point_cloud(points, 0.02);
    put(std::array<std::uint8_t, 1>{space.collides(cloud, shapes[2], here, Pose::at(0.0, 0.0, 1.2))});
    put(space.distance(cloud, shapes[2], here, Pose::at(0.0, 0.3, 1.3)));
    put(space.collides_batch(cloud, shapes[2], here, fall));
    put(space.distance_batch(cloud, shapes[2], here, fall).rows);
    Field::Nearest nearest = cloud.nearest(points, 2);
    put(nearest.distances);
    put(nearest.rows);
    put(cloud.within({0.2, 0.2, 0.2}, 0.15));
    std::vector<std::uint8_t> cells(24, 0);
    cells[3] = cells[17] = 1;
    Field grid = Field::voxel_grid(cells, {2, 3, 4}, {0.1, 0.1, 0.1}, {1.0, 0.0, 0.0});
    put(space.distance(grid, shapes[0], here, here));
    put(space.contacts(grid, shapes[1], here, Pose::at(1.05, 0.1, 0.71), 0.06, 4));
    put(space.contacts(cloud, shapes[1], here, Pose::at(0.32, 0.31, 0.93), 0.06, 4));
    const Pose under = Pose::at(0.35, 0.33, -2.0);
    put(std::array<collide_first_contact, 1>{space.cast(shapes[2], cloud, under, here, {0.02, -0.03, 1.0})});
    const std::array<double, 6> origins = {1.15, 0.13, 5.0, 1.04, 0.05, -3.0};
    const std::array<double, 6> ways = {0.0, 0.001, -1.0, 0.001, 0.0, 1.0};
    put(space.raycast(grid, here, origins, ways).rows);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::array<double, 9> heights = {0.1, 0.3, 0.2, 0.0, 0.4, 0.1, 0.2, 0.0, nan};
    put(space.distance(Mesh::height_field(heights, 3, {0.5, 0.25}, -1.0), shapes[0], here, Pose::at(0.1, 0.0, 1.0)));
}
"""


def test_every_class_has_pythons_bits(tmp_path):
    told = _run(_built(tmp_path, _ANSWERS))
    shapes = [
        collide.Sphere(0.3), collide.Box(0.4, 0.5, 0.6), collide.Capsule(0.1, 0.7), collide.Cylinder(0.2, 0.5),
        collide.Cone(0.3, 0.6), collide.Ellipsoid([0.2, 0.3, 0.4]), collide.Halfspace([0.0, 0.6, 0.8], -0.1),
        collide.ConvexHull([[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5]], radius=0.05),
        collide.HPolytope(np.kron(np.eye(3), [[1], [-1]]), np.full(6, 0.25)),
    ]
    there, here = np.eye(4), np.eye(4)
    there[:3] = [[0.8, -0.6, 0, 0.3], [0.6, 0.8, 0, 0.45], [0, 0, 1, 0.25]]
    fall = np.array([_at(0, 0, 0.45 + 0.05 * k) for k in range(5)])
    place = 0

    def reads(wanted: np.ndarray, what: str) -> None:
        nonlocal place
        wanted = np.ascontiguousarray(wanted)
        read = np.frombuffer(told[place : place + wanted.nbytes], dtype=wanted.dtype)
        assert read.tobytes() == wanted.tobytes(), f"{what}: {read}, {wanted}"
        place += wanted.nbytes

    box = shapes[1]
    for shape in shapes:
        reads(collide.distance(box, shape, here, there).rows, f"distance of {shape}")
        reads(collide.distance(box, shape, here, there, max_distance=0.01, signed=False).rows, f"limit of {shape}")
    hits = np.array([collide.collide(box, shape, here, there) for shape in shapes])
    assert 0 < hits.sum() < len(hits)
    reads(hits.astype(np.uint8), "booleans")
    sphere, cube = shapes[0], shapes[8]
    reads(collide.collide(sphere, box, here, fall).astype(np.uint8), "batch of booleans")
    reads(collide.distance(sphere, box, here, fall).rows, "batch of distances")
    some = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 7)]
    each = [(shapes[a], shapes[b], fall[k], here) for k, (a, b) in enumerate(some)]
    reads(np.array([collide.collide(*asked) for asked in each]).astype(np.uint8), "booleans of a set")
    reads(np.concatenate([collide.distance(*asked).rows for asked in each]), "distances of a set")
    reads(collide.contacts(box, cube, here, _at(0.1, 0, 0.54), margin=0.01, max_contacts=8).rows, "contacts")
    reads(_contacts([(box, cube, here, X) for X in fall]), "batch of contacts")
    reads(_contacts(each), "contacts of a set")
    mesh = collide.Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    met = [collide.collide(mesh, box, here, X) for X in (there, fall[0])]
    reads(np.array(met, dtype=np.uint8), "booleans of meshes")
    reads(collide.distance(mesh, box, here, _at(0, 0, 2)).rows, "distance of meshes")
    number, capsule = np.arange(300), shapes[2]
    points = np.stack([number % 7, number // 7 % 7, number // 49 % 7], axis=1) * 0.1
    cloud = collide.PointCloud(points, 0.02)
    reads(np.array([collide.collide(cloud, capsule, here, _at(0, 0, 1.2))], dtype=np.uint8), "boolean of a cloud")
    reads(collide.distance(cloud, capsule, here, _at(0, 0.3, 1.3), signed=False).rows, "distance of a cloud")
    reads(collide.collide(cloud, capsule, here, fall).astype(np.uint8), "booleans of a cloud")
    reads(collide.distance(cloud, capsule, here, fall, signed=False).rows, "distances of a cloud")
    nearest = cloud.nearest(points, k=2)
    reads(nearest.distance, "nearest points")
    reads(nearest.row, "numbers of nearest points")
    reads(np.asarray(cloud.within([0.2, 0.2, 0.2], 0.15), dtype=np.int64), "points within")
    cells = np.zeros(24, dtype=bool)
    cells[[3, 17]] = True
    grid = collide.VoxelGrid(cells.reshape(2, 3, 4), 0.1, _at(1, 0, 0))
    reads(collide.distance(grid, sphere, here, here, signed=False).rows, "distance of a grid")
    reads(collide.contacts(grid, box, here, _at(1.05, 0.1, 0.71), margin=0.06, max_contacts=4).rows, "on a grid")
    reads(collide.contacts(cloud, box, here, _at(0.32, 0.31, 0.93), margin=0.06, max_contacts=4).rows, "on a cloud")
    met = collide.shape_cast(capsule, _at(0.35, 0.33, -2), (0.02, -0.03, 1.0), cloud, here)
    reads(told_of_cast(met), "cast onto a cloud")
    hits = collide.raycast(grid, here, [[1.15, 0.13, 5.0], [1.04, 0.05, -3.0]], [[0, 0.001, -1.0], [0.001, 0, 1.0]])
    reads(np.array([told_of_ray(hits, k) for k in range(2)]), "rays at a grid")
    heights = [[0.1, 0.3, 0.2], [0.0, 0.4, 0.1], [0.2, 0.0, np.nan]]
    terrain = collide.HeightField(heights, (0.5, 0.25), bottom=-1.0)
    reads(collide.distance(terrain, sphere, here, _at(0.1, 0, 1), signed=False).rows, "distance of a height field")
    assert hits.hit.all() and place == len(told)


def _at(*xyz: float) -> np.ndarray:
    X = np.eye(4)
    X[:3, 3] = xyz
    return X


def _contacts(asked: list) -> np.ndarray:
    rows = [collide.contacts(*pair, margin=0.06, max_contacts=4).rows for pair in asked]
    assert sum(map(len, rows)) > 4 and rows[0].dtype == CONTACT_DTYPE
    return np.concatenate(rows)


_BODIES = r"""
#include <collide.hpp>
#include <cstdio>
using namespace collide;

template <class... Numbers> void say(const char *what, Numbers... numbers) {
    std::printf("%s", what);
    (std::printf(" %.17g", double(numbers)), ...);
    std::printf("\n");
}
template <class Rows> void distances(const char *what, const Rows &rows) {
    for (const auto &row : rows) say(what, row.a, row.b, row.distance, row.lower, row.upper);
}

int main() {
    Workspace space;
    Shape block = Shape::box({0.4, 0.5, 0.6}), ball = Shape::sphere(0.3), rod = Shape::cylinder(0.1, 0.8);
    const Pose here, up = Pose::at(0.1, 0.0, 1.5);
    const std::array<double, 12> vertices = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    const std::array<std::int32_t, 12> faces = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    Mesh mesh(vertices, faces), other(block);
    std::vector<Pose> fall = {up, Pose::at(0.1, 0.0, 0.55), Pose::at(0.1, 0.0, 0.9)};

    for (auto hit : space.within_batch(block, ball, here, fall, 0.31)) say("within", hit);
    for (const auto &row : space.cast_batch(ball, block, fall, here, Vector{0.0, 0.1, -2.0}, 5.0).rows)
        say("cast", row.distance, row.lower, row.upper, row.hit);
    for (const auto &row : space.impact_batch(rod, block, up, Pose::at(0.1, 0.3, -1.0), here, here, 1e-10).rows)
        say("impact", row.time, row.lower, row.upper, row.hit);
    const std::vector<double> origins = {0.1, 0.1, 3.0, 2.0, 2.0, 3.0}, down = {0.0, 0.01, -1.0};
    const std::vector<double> ways = {0.0, 0.01, -1.0, 0.0, 0.01, -1.0};
    for (const auto &row : space.raycast(block, here, origins, down).rows) say("ray", row.distance, row.hit);
    for (const auto &row : space.raycast(mesh, here, origins, down).rows)
        say("ray at mesh", row.distance, row.hit, row.facet);
    say("mesh", space.collides(mesh, ball, here, up), space.collides(mesh, ball, here, here),
        space.distance(mesh, ball, here, up).distance);
    for (const auto &row : space.contacts(mesh, other, here, Pose::at(0.2, 0.25, -0.299), 0.01))
        say("patch", row.distance);

    const collide_shape *parts[] = {block.get(), ball.get()};
    const Pose places[] = {here, Pose::at(0.0, 0.0, 0.5)};
    Compound gripper(parts, places), single(Span<const collide_shape *const>(parts, 1), Span<const Pose>(places, 1));
    for (auto hit : space.collides_batch(gripper, single, here, fall)) say("union", hit);
    distances("of union", space.distance_batch(gripper, single, here, fall));
    for (const auto &row : space.contacts(gripper, single, here, Pose::at(0.0, 0.0, -0.61), 0.02))
        say("of parts", row.distance);

    for (const auto &row : space.contacts(mesh, rod, here, Pose::at(0.2, 0.2, -0.395), 0.02, 8))
        say("rod", row.distance);
    collide_first_contact first = space.cast(gripper, single, up, here, Vector{0.0, 0.1, -2.0}, 5.0);
    say("cast of union", first.distance, first.lower, first.upper, first.hit, first.part_a, first.part_b);
    for (const auto &row : space.raycast(gripper, here, origins, down).rows)
        say("ray at union", row.distance, row.hit, row.part);

    World world;
    std::int32_t floor = world.add(block, Pose(), true), top = world.add(ball, up);
    std::int32_t third = world.add(mesh, Pose::at(3.0, 0.0, 0.0)), last = world.add(rod, Pose::at(5.0, 0.0, 0.0));
    say("ids", floor, top, third, last, world.size());
    say("none", world.collides(space), world.hits(space).size());
    world.move(top, Pose::at(0.1, 0.0, 0.55));
    world.move(std::vector<std::int32_t>{last}, std::vector<Pose>{Pose::at(-1.0, 0.0, 0.0)});
    say("pose", world.pose(last)(0, 3), world.collides(space), world.hits(space)[0], world.hits(space)[1]);
    distances("collision", world.collisions(space));
    distances("near", world.distances(space, 0.9));
    say("minimum", world.minimum(space)->distance, world.minimum(space, 0.0).has_value());
    for (const auto &row : world.contacts(space, 0.01)) say("contact", row.a, row.b, row.distance);
    distances("query", world.query(space, rod, Pose::at(0.0, 0.0, 1.5), 1.0));
    for (auto id : world.boxes_near(space, {-2.0, -1.0, -1.0}, {0.0, 1.0, 1.0})) say("box", id);
    world.remove(third);
    for (const auto &row : world.raycast(space, origins, ways).rows) say("world ray", row.body, row.distance);
    for (const auto &row : world.nearest(space, origins)) say("nearest", row.body, row.distance);
    for (const auto &row : world.cast(space, ball, Pose::at(0.1, 0.0, 4.0), ways).rows)
        say("world cast", row.body, row.distance);
    world.allow(std::vector<std::int32_t>{floor, top});
    say("allowed", world.collides(space));
    world.set_margins(std::vector<std::int32_t>{floor, last}, std::vector<double>{0.01, 10.0});
    world.set_pair_margin(top, last, 0.0);
    world.set_margin(top, 0.5);
    distances("margins", world.collisions(space));
    say("within", world.within(space, 0.0), world.within(space, 10.0));
    try {
        world.move(99, here);
    } catch (const Error &error) {
        std::printf("%s\n", error.what());
    }
}
"""


def _said(what: str, *numbers) -> list[str]:
    """A line of the program for each row of columns of numbers."""
    rows = np.atleast_2d(np.array([np.atleast_1d(column) for column in numbers], dtype=float).T)
    return [" ".join([what, *(format(value, ".17g") for value in row)]) for row in rows.tolist()]


def _pairs(what: str, result) -> list[str]:
    return _said(what, *(result.rows[field] for field in ("a", "b", "distance", "lower", "upper")))


def test_unions_casts_and_worlds_are_pythons(tmp_path):
    block, ball, rod = collide.Box(0.4, 0.5, 0.6), collide.Sphere(0.3), collide.Cylinder(0.1, 0.8)
    mesh = collide.Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    here, up, fall = np.eye(4), _at(0.1, 0, 1.5), np.array([_at(0.1, 0, z) for z in (1.5, 0.55, 0.9)])
    lines = _said("within", collide.collide(block, ball, here, fall, security_margin=0.31))
    cast = collide.shape_cast(ball, fall, [0.0, 0.1, -2.0], block, here, max_distance=5.0)
    lines += _said("cast", cast.distance, cast.lower, cast.upper, cast.hit)
    impact = collide.time_of_impact(rod, block, up, _at(0.1, 0.3, -1), here, here, tolerance=1e-10)
    lines += _said("impact", impact.time, impact.lower, impact.upper, impact.hit)
    origins, down = [[0.1, 0.1, 3.0], [2.0, 2.0, 3.0]], [0.0, 0.01, -1.0]
    ray, at_mesh = (collide.raycast(shape, here, origins, down) for shape in (block, mesh))
    lines += _said("ray", ray.distance, ray.hit) + _said("ray at mesh", at_mesh.distance, at_mesh.hit, at_mesh.facet)
    far = collide.distance(mesh, ball, here, up, signed=False).distance
    lines += _said("mesh", collide.collide(mesh, ball, here, up), collide.collide(mesh, ball, here, here), far)
    lines += _said("patch", collide.contacts(mesh, block, here, _at(0.2, 0.25, -0.299), margin=0.01).distance)
    gripper = collide.Compound([(block, here), (ball, _at(0, 0, 0.5))])
    lines += _said("union", collide.collide(gripper, block, here, fall))
    lines += _pairs("of union", collide.distance(gripper, block, here, fall))
    lines += _said("of parts", collide.contacts(gripper, block, here, _at(0, 0, -0.61), margin=0.02).distance)
    rods = collide.contacts(mesh, rod, here, _at(0.2, 0.2, -0.395), margin=0.02)
    assert len(rods) > 4
    lines += _said("rod", rods.distance)
    cast = collide.shape_cast(gripper, up, [0.0, 0.1, -2.0], block, here, max_distance=5.0)
    lines += _said("cast of union", cast.distance, cast.lower, cast.upper, cast.hit, cast.item_a, cast.item_b)
    ray = collide.raycast(gripper, here, origins, down)
    lines += _said("ray at union", ray.distance, ray.hit, ray.item)
    lines += _of_world(block, ball, rod, mesh, up, np.array(origins), np.array([down, down]))
    assert _run(_built(tmp_path, _BODIES)).decode().splitlines() == lines


def _of_world(block, ball, rod, mesh, up, origins, ways) -> list[str]:
    world = collide.World()
    world.add(block, static=True, name="0")
    world.add(ball, up, name="1")
    world.add(mesh, _at(3, 0, 0), name="2")
    world.add(rod, _at(5, 0, 0), name="3")
    lines = [*_said("ids", 0, 1, 2, 3, 4), *_said("none", world.collides(), len(world.collisions()))]
    world.set_pose("1", _at(0.1, 0, 0.55))
    world.set_pose("3", _at(-1, 0, 0))
    lines += _said("pose", -1.0, world.collides(), 0, 1) + _pairs("collision", world.collisions())
    lines += _pairs("near", world.distances(max_distance=0.9))
    lines += _said("minimum", world.minimum().rows["distance"][0], 1)
    contacts = world.contacts(margin=0.01)
    lines += _said("contact", *(contacts.rows[field] for field in ("a", "b", "distance")))
    lines += _pairs("query", world.query(rod, _at(0, 0, 1.5), max_distance=1.0))
    lines += _said("box", [int(name) for name in world.boxes_near([-2, -1, -1], [0, 1, 1])])
    world.remove("2")
    rays, nearest = world.raycast(origins, ways), world.nearest(origins)
    moved = world.shape_cast(ball, _at(0.1, 0, 4), ways)
    for what, found in (("world ray", rays), ("nearest", nearest), ("world cast", moved)):
        lines += _said(what, [-1 if name is None else int(name) for name in found.names], found["distance"])
    world.allow("0", "1")
    lines += _said("allowed", world.collides())
    world.set_margin("0", 0.01)
    world.set_margin("3", 10.0)
    world.set_margin("1", 0.0, partner="3")
    world.set_margin("1", 0.5)
    lines += _pairs("margins", world.collisions())
    lines += _said("within", world.collides(), world.collides(security_margin=10.0))
    refused = "collide_world_move: ids[0]: no body has id 99; it may have been removed"
    return [*lines, f"collide: an argument is NULL or outside its range: {refused}"]


_ROBOT = r"""
#include <collide.hpp>
#include <cstdio>
using namespace collide;

template <class Rows> void put(const Rows &rows) { std::fwrite(rows.data(), sizeof *rows.data(), rows.size(), stdout); }

int main() {
    Robot robot = Robot::load("robot.collide");
    RobotWorkspace space(robot);
    std::vector<double> q(40 * robot.columns());
    std::FILE *file = std::fopen("q.bin", "rb");
    if (file == nullptr || std::fread(q.data(), sizeof(double), q.size(), file) != q.size()) return 2;
    std::fclose(file);
    const std::size_t half = q.size() / 2;
    const Span<const double> first(q.data(), half), last(q.data() + half, half);
    put(space.collides(q).rows);
    RobotDistances nearest = space.distances(q, infinity, COLLIDE_WITH_AROUND);
    for (const collide_pair &row : nearest.rows) put(std::array<double, 3>{row.distance, row.lower, double(row.b)});
    put(nearest.gradients);
    RobotPairs near = space.near(q, 5.0);
    put(near.starts);
    put(near.gradients);
    RobotMotions certified = space.certify(first, last, 0.05), sampled = space.sample(first, last, 0.05);
    put(certified.rows);
    put(certified.times);
    put(sampled.rows);
    const std::vector<std::int32_t> around = {-1, -2};
    space.move_around(around, std::vector<Pose>{Pose::at(0.3, 0.1, 0.0), Pose::at(-0.2, 0.1, 0.1)});
    space.move_around(-1, Pose::at(0.2, 0.0, 0.1));
    put(space.collides(q).rows);
    put(space.distances(q, infinity, COLLIDE_WITH_AROUND).gradients);
    if (robot.around() != 2 || space.pose_around(-1)(2, 3) != 0.1 || space.pose_around(-2)(0, 3) != -0.2) return 6;
    try {
        space.move_around(-3, Pose());
        return 7;
    } catch (const Error &error) {
        if (error.status() != COLLIDE_INVALID_ARGUMENT || error.index() != 0) return 8;
    }
    Shape box = Shape::box({0.3, 0.3, 0.4});
    const collide_shape *parts[] = {box.get()};
    const Pose at = Pose::at(0.0, 0.0, 0.2);
    Compound object(parts, Span<const Pose>(&at, 1));
    const std::vector<std::int32_t> touch = {1};
    const std::int32_t carried = space.attach(0, object, Pose::at(0.1, 0.0, 0.0), 0.0, touch);
    put(space.collides(q).rows);
    space.allow(std::vector<std::int32_t>{carried, -2, -1, carried, 2, carried});
    put(space.collides(q).rows);
    space.detach(carried);
    put(space.collides(q).rows);
    if (robot.column_name(0).empty() || robot.body_name(0).empty() || robot.body_name(-1) != "ball") return 5;
    try {
        space.collides({q.data(), robot.columns() + 1});
        return 3;
    } catch (const Error &error) {
        return error.status() == COLLIDE_INVALID_ARGUMENT ? 0 : 4;
    }
}
"""


def test_robots_are_pythons(tmp_path):
    rng, world = rng_of("a robot in C++ 0"), collide.World()
    world.add(collide.Sphere(0.1), _at(0.4, 0, 0), name="ball")
    world.add(collide.Box(0.2, 0.2, 0.2), _at(-0.4, 0.2, 0), name="crate")
    robot = random_robot(rng, types=("revolute", "prismatic"), size=0.03)
    checker, q = collide.RobotChecker(robot, world), random_configurations(rng, robot, 40)
    checker.save(tmp_path / "robot.collide")
    q.tofile(tmp_path / "q.bin")
    told = _run(_built(tmp_path, _ROBOT))
    hits, nearest = checker.collides(q), checker.distances(q, between="world")
    pairs = checker.distances(q, max_distance=5.0, per="pair")
    edges = checker.certify_edges(q[:20], q[20:], resolution=0.05)
    verdicts = np.where(edges.free, 1, np.where(edges.collides, 2, 0)).astype(np.uint8)
    assert 0 < hits.sum() < 40 and len(pairs) > 64 + 16 * 40 and len(np.unique(verdicts)) > 1
    sampled = checker.edge_collides(q[:20], q[20:], resolution=0.05)
    wanted = [
        hits.astype(np.uint8), np.stack([nearest.distance, nearest.lower, nearest.b], axis=1).astype(float),
        nearest.gradient, pairs.starts, pairs.gradient, verdicts, edges.time, sampled.astype(np.uint8),
    ]
    world.set_pose("ball", _at(0.2, 0, 0.1))
    world.set_pose("crate", _at(-0.2, 0.1, 0.1))
    assert (checker.collides(q) != hits).any()
    wanted += [checker.collides(q).astype(np.uint8), checker.distances(q, between="world").gradient]
    held = collide.Compound([(collide.Box(0.3, 0.3, 0.4), _at(0, 0, 0.2))])
    checker.attach("held", checker.bodies[0], held, _at(0.1, 0, 0), touch=[checker.bodies[1]])
    wanted.append(checker.collides(q).astype(np.uint8))
    for name in (*checker.around, checker.bodies[2]):
        checker.allow("held", name)
    wanted.append(checker.collides(q).astype(np.uint8))
    checker.detach("held")
    wanted.append(checker.collides(q).astype(np.uint8))
    assert (wanted[-3] != wanted[-2]).any()
    assert told == b"".join(column.tobytes() for column in wanted)


_OWNERS = r"""
#include <collide.hpp>
#include <cstdio>
#include <cstring>
using namespace collide;

template <class Function> collide_status status_of(Function ask) {
    try {
        ask();
    } catch (const Error &error) {
        if (std::strstr(error.what(), collide_status_text(error.status())) == nullptr) return COLLIDE_OK;
        return error.status();
    }
    return COLLIDE_OK;
}
#define EXPECT(condition) \
    if (!(condition)) return std::fprintf(stderr, "line %d: %s\n", __LINE__, #condition), 1

int main() {
    static_assert(!std::is_copy_constructible_v<Shape> && std::is_nothrow_move_constructible_v<Shape>);
    static_assert(!std::is_copy_constructible_v<Workspace> && std::is_nothrow_move_assignable_v<Mesh>);
    static_assert(!std::is_convertible_v<std::vector<double>, Span<int>>, "a span is of its elements");
    Workspace space;
    Shape ball = Shape::sphere(1.0), moved = std::move(ball);
    EXPECT(!ball && moved);
    ball = Shape::sphere(2.0);  // a new one in an empty place, then another over it
    ball = std::move(moved);
    EXPECT(ball && !moved);
    const Pose X, off = Pose::at(0.0, 0.0, 1.5);
    EXPECT(space.collides(ball, ball, X, off));
    EXPECT(status_of([&] { space.collides(ball, moved, X, X); }) == COLLIDE_INVALID_ARGUMENT);
    EXPECT(status_of([] { Shape::sphere(-1.0); }) == COLLIDE_INVALID_SHAPE);
    EXPECT(status_of([] { Shape::hull(std::vector<double>(4)); }) == COLLIDE_INVALID_ARGUMENT);
    EXPECT(status_of([] { Shape::hull(Span<const double>()); }) == COLLIDE_INVALID_ARGUMENT);
    const std::vector<double> one(1), six(6);
    EXPECT(status_of([&] { Shape::hpolytope(six, one); }) == COLLIDE_INVALID_ARGUMENT);
    EXPECT(status_of([] { ShapeSet empty{Span<const Shape>()}; }) == COLLIDE_INVALID_ARGUMENT);
    EXPECT(status_of([&] { space.collides(ball, ball, X, std::array<double, 16>{}); }) == COLLIDE_INVALID_POSE);
    Shape floor = Shape::halfspace({0.0, 0.0, 1.0}, 0.0);
    EXPECT(status_of([&] { space.distance(floor, floor, X, X); }) == COLLIDE_ENDLESS_DEPTH);
    EXPECT(space.collides(floor, floor, X, X));
    EXPECT(status_of([&] { Mesh made(floor); }) == COLLIDE_UNSUPPORTED);
    std::vector<std::uint8_t> cells(5, 1);
    EXPECT(status_of([&] { Field::voxel_grid(cells, {2, 1, 2}, {1.0, 1.0, 1.0}); }) == COLLIDE_INVALID_ARGUMENT);
    const std::size_t huge = std::size_t(1) << 32;
    EXPECT(status_of([&] { Field::voxel_grid({}, {huge, huge, 1}, {1.0, 1.0, 1.0}); }) == COLLIDE_INVALID_ARGUMENT);
    EXPECT(status_of([&] { Field::voxel_grid(cells, {huge, huge, 5}, {1.0, 1.0, 1.0}); }) == COLLIDE_INVALID_ARGUMENT);
    Field cloud = Field::point_cloud(std::array<double, 3>{}, 0.1);
    EXPECT(cloud.within({5.0, 0.0, 0.0}, 1.0).empty() && cloud.within({0.5, 0.0, 0.0}, 1.0).size() == 1);
    EXPECT(cloud.nearest(std::array<double, 3>{}, 2).rows[1] == -1);

    std::vector<Pose> poses(3);
    poses[2].m[0] = 2.0;
    try {
        space.distance_batch(ball, ball, poses, X);
        return 1;
    } catch (const Error &error) {
        EXPECT(error.status() == COLLIDE_INVALID_POSE && error.index() == 2);
        EXPECT(std::string(error.what()).find("pair 2") != std::string::npos);
    }
    std::vector<double> axes(8);
    EXPECT(status_of([&] { space.collides_batch(ball, ball, X, off, 0, axes); }) == COLLIDE_INVALID_ARGUMENT);
    axes.assign(3, 0.0);
    EXPECT(space.collides_batch(ball, ball, X, Pose::at(5.0, 0.0, 0.0), 0, axes)[0] == 0 && axes[0] != 0.0);
    EXPECT(space.collides_batch(ball, ball, Poses(), X).empty());
    // Balls that nearly meet others: rows without an answer stand beside answers.
    std::vector<Pose> deep(2);
    deep[1] = Pose::at(3.0, 0.0, 0.0);
    const std::vector<double> two = {0.0, 0.0, 0.0, 0.05, 0.0, 0.0};
    Answered<collide_pair> told = space.distance_batch(Field::point_cloud(two, 0.1), ball, X, deep, infinity, 0);
    EXPECT(told.statuses[0] == COLLIDE_UNSUPPORTED && told.statuses[1] == COLLIDE_OK && told.rows[1].distance > 1.8);
    EXPECT(status_of([] { Robot::load("no such file"); }) == COLLIDE_INVALID_FILE);
    EXPECT(status_of([&] { Robot::read(cells); }) == COLLIDE_INVALID_FILE);
    return 0;
}
"""


@pytest.mark.parametrize("options", [[], ADDRESSES], ids=["plain", "sanitized"])
def test_owners_and_errors(tmp_path, options):
    _run(_built(tmp_path, _OWNERS, *options))


_EIGEN = r"""
#include <collide.hpp>
#ifndef COLLIDE_WITH_EIGEN
#error Eigen is on the path
#endif
int main() {
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    X.translate(Eigen::Vector3d(2.0, 0.0, 0.0)).rotate(Eigen::AngleAxisd(0.5, Eigen::Vector3d(1.0, 2.0, 2.0) / 3.0));
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> by_rows = X.matrix();
    collide::Pose a(X), b(X.matrix()), c(by_rows), d(Eigen::AffineCompact3d(X.matrix().topRows<3>()));
    if (a.m != b.m || a.m != c.m || a.m != d.m || a(0, 3) != 2.0 || a(1, 0) != X(1, 0) || a(1, 0) == X(0, 1)) return 1;
    collide::Workspace space;
    collide_pair pair = space.distance(collide::Shape::sphere(0.5), collide::Shape::sphere(0.25), collide::Pose(), X);
    return (collide::vector(pair.normal) - Eigen::Vector3d::UnitX()).norm() < 1e-15 && pair.distance == 1.25 ? 0 : 2;
}
"""


@pytest.mark.slow
def test_poses_are_made_of_eigens(tmp_path):
    if EIGEN is None:
        pytest.skip("no Eigen on this machine: apt-get install libeigen3-dev")
    _run(_built(tmp_path, _EIGEN, "-isystem", EIGEN))


def test_without_eigen_no_word_of_it_is_read(tmp_path):
    text = "#include <collide.hpp>\n#ifdef COLLIDE_WITH_EIGEN\n#error read\n#endif\nint main() {}\n"
    _run(_built(tmp_path, text, "-DCOLLIDE_WITHOUT_EIGEN", *([] if EIGEN is None else ["-isystem", EIGEN])))



def test_the_page_says_what_runs(tmp_path):
    page = (Path(__file__).resolve().parents[2] / "docs" / "c-interface.md").read_text(encoding="utf-8")
    (snippet,) = re.findall(r"```cpp\n(.*?)```", page, re.DOTALL)
    ending = "return pairs.size() == 100 && pairs[0].distance == 0.5 && pairs[99].hit ? 0 : 1;"
    _run(_built(tmp_path, f"#include <collide.hpp>\nint main() {{\n{snippet}{ending}\n}}\n"))
