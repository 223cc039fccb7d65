"""Every public function is asked with bad arguments: what comes out is an answer or an error of collide.

The fuzzer reads the signatures (`tests/oracles/argument_fuzzer.py`); as a script it tries every value everywhere.
"""

from __future__ import annotations

import argument_fuzzer as fuzzer

import collide

#: How many of the bad values each parameter of each public callable is given here, other ones for every seed.
EACH, SEED = 3, 2


def test_every_public_name_is_reached_or_excused():
    tried, unknown = fuzzer.targets()
    assert not unknown, "give good arguments in GOOD, METHODS or OBJECTS, or a reason in EXCUSED"
    names = {target.name for target in tried}
    public = {name for name, _ in fuzzer.public_names()}
    stale = {name for name in fuzzer.EXCUSED if name not in public and "." not in name}
    assert not stale and len(names) > 140, (stale, len(names))
    methods = {name.rsplit(".", 1)[0] for name in names if "." in name}
    left_out = {
        name
        for name, value in fuzzer.public_names()
        if name not in names | methods and name not in fuzzer.EXCUSED
        and not (isinstance(value, type) and issubclass(value, (tuple, BaseException)))
    }
    assert not left_out


def test_good_arguments_are_good():
    """Otherwise the first of them would be refused, and the bad one never be looked at."""
    absent = {"read_sweep", "scenes.allow_pairs", "TetMesh.from_file", "Robot.load", "Mesh.load", "ConvexHull.load",
              "HeightField.load", "PointCloud.load", "SignedDistanceGrid.load"}
    refused = {}
    for target in fuzzer.targets()[0]:
        if target.name not in absent and target.name != "sweep" and not target.name.endswith(".save"):
            try:
                target.call()(**target.good())
            except Exception as error:  # noqa: BLE001 - whatever it is, the arguments are not good
                refused[target.name] = error
    assert not refused, list(refused)


def has_arguments(target) -> bool:
    return any(parameter.name not in fuzzer.CALLBACKS for parameter in target.parameters)


def test_bad_arguments_are_refused_by_name():
    """Every parameter of every public callable; a message names the parameter, and shows the value."""
    chosen = fuzzer.cases(SEED, EACH)
    assert {target.name for target, *_ in chosen} == {t.name for t in fuzzer.targets()[0] if has_arguments(t)}
    counts, complaints = fuzzer.run(chosen)
    assert not complaints, "\n".join(complaints)
    assert counts["refused"] > 0.5 * len(chosen) > 600, counts
    assert counts["taken"] > 10, "some bad values are good ones elsewhere"


def test_messages_name_the_argument_and_the_value():
    for call, words in (
        (lambda: collide.contains(fuzzer.BOX, fuzzer.EYE, (0, 0, 0), check_poses=[1, 2]),
         ("check_poses", "True or False", "[1, 2]")),
        (lambda: collide.tessellate(fuzzer.BOX, size=10**400), ("tessellate: size", "an integer of 1329 bits")),
        (lambda: collide.World().boxes_near("a", (0, 0, 0)), ("World.boxes_near: low_W", "'a'")),
        (lambda: collide.World().sleep(7), ("bodies", "ids or names", "7")),
        (lambda: fuzzer.tetrahedron().exact_volume(4), ("TetMesh.exact_volume: cell", "0 … 0", "4")),
        (lambda: fuzzer.robot().joint_value("elbow", [0.0]), ("'elbow'", "slide")),
        (lambda: fuzzer.robot().renamed(None), ("prefix", "None")),
        (lambda: fuzzer.polytopes.hull_boundary(3), ("hull_boundary: body", "HierarchicalTree", "3")),
        (lambda: fuzzer.partition().convex_pieces().hull(1.5), ("ConvexCells: i", "1.5")),
    ):
        try:
            call()
        except collide.CollideError as error:
            assert all(word in str(error) for word in words), str(error)
        else:
            raise AssertionError(words)
