"""The commands solid, cells and obstacle: solids made of the bodies of files, written as meshes for other programs."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from typing import Any

from collide.cli import pages as cli_pages
from collide.cli.files import MESH_SUFFIXES, check_place, write_json
from collide.errors import InvalidArgument
from collide.reports.number_format import brief_length, count, volume

SOLID = """examples:
  collide solid housing.stl difference shaft.obj --scale mm --out bored.3mf
  collide solid room.yaml union a.stl --without floor --out w.glb --html w.html
  collide solid crate.yaml intersection post.stl --pose 0.4,0,0 --out clash.ply

A and B are files, or names of shipped scenes; of several bodies their union is
taken, all in one exact arrangement. Facets have the colour of the body that
they come from (PLY, OFF, 3MF, GLB). Vertices are rounded once; the summary says
how far. docs/solids.md is the manual.

exit status: 0 written, 1 the result is empty and nothing is written, 2 error"""

CELLS = """examples:
  collide cells housing.stl --scale mm --out pieces.glb
  collide cells workcell --free --without floor --tolerance 1cm --out f.json
  collide cells room.yaml --free --box 0,0,0,6,4,2.5 --out f.3mf --html f.html

The bodies of a scene, or with --free what is free around them in a box, as
convex cells without common inner points: exactly the solid, or exactly the
rest of the box, corners rounded. A mesh file has the surfaces of all cells, in
colours; a .json file corners, faces and volumes, and which cells open into one
another, where and how wide: the graph of a planner. docs/partitions.md.

exit status: 0 written, 1 no cell and nothing is written, 2 error"""

OBSTACLE = """examples:
  collide obstacle shelf.stl box.stl --out obstacle.stl
  collide obstacle shelf.obj hand.obj --rpy 0,0,1.57 --repair --out where.glb
  collide obstacle housing.stl peg.stl --out w.ply --html w.html --json w.json

All positions of B at which it meets A, as a solid: B, turned by --rpy and moved
by x without turning, is free of A exactly where the point x is outside. The
bodies of A together are one solid, and those of B; A stands as its file says.
docs/configuration_obstacles.md is the manual.

exit status: 0 written, 2 error"""


def add_solid_arguments(parser: argparse.ArgumentParser, add_mesh_arguments: Callable, length: Callable) -> None:
    parser.add_argument("a", metavar="A", help="a file, or the name of a shipped scene")
    parser.add_argument("operation", choices=("union", "intersection", "difference", "symmetric_difference"),
                        metavar="OP", help="union, intersection, difference (A without B) or symmetric_difference")
    parser.add_argument("b", metavar="B", help="the same")
    add_mesh_arguments(parser)
    group = _out_arguments(parser, length, MESH_SUFFIXES)
    group.add_argument("--pose", type=_numbers(3, 6), metavar="X,Y,Z[,R,P,Y]",
                       help="where B stands: metres, and roll, pitch, yaw in radians")


def add_cells_arguments(parser: argparse.ArgumentParser, add_mesh_arguments: Callable, length: Callable) -> None:
    parser.add_argument("a", metavar="SCENE", help="a file, or the name of a shipped scene")
    add_mesh_arguments(parser)
    group = _out_arguments(parser, length, (*MESH_SUFFIXES, ".json"))
    group.add_argument("--free", action="store_true", help="cells of what is free, not of the bodies")
    group.add_argument("--box", type=_numbers(6), metavar="X,Y,Z,X,Y,Z",
                       help="with --free: two corners of the box (around the bodies, a tenth larger on all sides)")


def add_obstacle_arguments(parser: argparse.ArgumentParser, add_mesh_arguments: Callable, length: Callable) -> None:
    parser.add_argument("a", metavar="A", help="a file, or the name of a shipped scene: what stands")
    parser.add_argument("b", metavar="B", help="the same: what moves without turning")
    add_mesh_arguments(parser)
    group = _out_arguments(parser, length, MESH_SUFFIXES)
    turned = group.add_mutually_exclusive_group()
    turned.add_argument("--rpy", type=_numbers(3), metavar="R,P,Y", help="how B is turned first: radians")
    turned.add_argument("--rpy-deg", type=_numbers(3), metavar="R,P,Y", help="the same in degrees")


def _out_arguments(parser: argparse.ArgumentParser, length: Callable, suffixes: tuple[str, ...]):
    group = parser.add_argument_group("result")
    group.add_argument("--out", metavar="FILE", required=True, help=f"the file to write: {', '.join(suffixes)}")
    group.add_argument("--without", action="append", default=[], metavar="NAME",
                       help="leave this body out, such as a floor without end; may be given again")
    group.add_argument("--tolerance", type=length, metavar="D",
                       help="take triangles within this of spheres, cylinders and other curved shapes: 0.001, 1mm")
    return group


def _numbers(*lengths: int) -> Callable[[str], list[float]]:
    """A type of arguments: finite numbers, as many as one of the lengths."""

    def numbers(text: str) -> list[float]:
        import math

        try:
            values = [float(word) for word in text.split(",")]
        except ValueError:
            values = []
        if len(values) not in lengths or not all(map(math.isfinite, values)):
            wanted = " or ".join(map(str, lengths))
            raise argparse.ArgumentTypeError(f"must be {wanted} numbers separated by commas, got {text!r}")
        return values

    return numbers


# --- running --------------------------------------------------------------------------------------


def run_solid(args: argparse.Namespace, progress: Callable) -> int:
    """Write the boolean of two files; 0, or 1 of an empty one."""
    from collide import combine

    _check_out(args, MESH_SUFFIXES, args.a, args.b)
    A, B = _solids(args, progress, args.a, args.b)
    B = [_moved(solid, args.pose) for solid in B]
    keep = {
        "union": lambda a, b: a or b, "intersection": lambda a, b: a and b, "difference": lambda a, b: a and not b,
        "symmetric_difference": lambda a, b: a != b,
    }[args.operation]
    solids, n = [*A, *B], len(A)
    r = combine(
        [solid.shape for solid in solids], [solid.X_WS for solid in solids],
        lambda held: keep(any(held[:n]), any(held[n:])), progress=progress,
    )
    name = f"{_stem(args.a)} {args.operation} {_stem(args.b)}"
    if r.mesh is None:
        return _nothing(args, name, {"operation": args.operation, "empty": True})
    r.save(args.out)
    names = [solid.name for solid in solids]
    facets = {name: int((r.body == k).sum()) for k, name in enumerate(names) if (r.body == k).any()}
    about = {
        "operation": args.operation, "empty": False, **_about(r.mesh), "moved": r.moved,
        "crossing": len(r.self_collisions), "facets_of": facets,
    }
    _finish(args, name, r.mesh, about, [f"moved by {brief_length(r.moved)} at most"], progress)
    return 0


def run_cells(args: argparse.Namespace, progress: Callable) -> int:
    """Write convex cells of a solid, or of the free space around; 0, or 1 where there is no cell."""
    from collide import SpacePartition
    from collide.scenes.cell_files import cell_graph, cell_surfaces, save_cells
    from collide.scenes.scene_solids import union_of

    _check_out(args, (*MESH_SUFFIXES, ".json"), args.a)
    if args.box is not None and not args.free:
        raise InvalidArgument("--box: cells of the bodies fill them, and need no box; give --free too, or leave it out")
    (solids,) = _solids(args, progress, args.a)
    mesh, moved = union_of(solids, progress)
    partition = SpacePartition(mesh, progress=progress)
    with progress("joining cells"):
        box = _box(mesh, args.box) if args.free else None
        cells = partition.convex_pieces(inside=not args.free, box=box)
    name = f"{'free space around' if args.free else 'cells of'} {_stem(args.a)}"
    if not len(cells):
        return _nothing(args, name, {"free": args.free, "cells": 0})
    mesh = cell_surfaces(cells)[0]
    about = {
        "free": args.free, "cells": len(cells), "facets": len(mesh.faces), "volume": float(cells.volumes.sum()),
        "moved": moved + cells.error, "box": None if box is None else [corner.tolist() for corner in box],
    }
    if args.out.lower().endswith(".json"):
        with progress("finding portals"):
            portals = partition.portals(cells)
        write_json({**about, **cell_graph(cells, portals)}.items(), args.out)
        about["portals"] = len(portals.cells)
    else:
        save_cells(args.out, cells)
    _finish(args, name, mesh, about, [count(len(cells), "convex cell")], progress)
    return 0


def run_obstacle(args: argparse.Namespace, progress: Callable) -> int:
    """Write the configuration obstacle of two files; 0."""
    import numpy as np

    from collide import configuration_obstacle, pose
    from collide.scenes.scene_solids import union_of

    _check_out(args, MESH_SUFFIXES, args.a, args.b)
    bodies: list[Any] = []
    moved = 0.0
    for solids in _solids(args, progress, args.a, args.b):
        if len(solids) == 1 and np.array_equal(solids[0].X_WS, np.eye(4)):
            bodies.append(solids[0].shape)
        else:
            mesh, off = union_of(solids, progress)
            bodies.append(mesh)
            moved += off
    R = pose(rpy=args.rpy, rpy_deg=args.rpy_deg)[:3, :3] if args.rpy or args.rpy_deg else None
    r: Any = configuration_obstacle(bodies[0], bodies[1], R, progress=progress)
    r.mesh.save(args.out)
    name = f"obstacle {_stem(args.a)} to {_stem(args.b)}"
    moved += r.moved
    about = {**_about(r.mesh), "moved": moved, "crossing": len(r.self_collisions), "pieces": r.n_pieces}
    _finish(args, name, r.mesh, about, [f"moved by {brief_length(moved)} at most"], progress)
    return 0


def _check_out(args: argparse.Namespace, suffixes: tuple[str, ...], *sources: str) -> None:
    """Refuse, before the work, a file that is no mesh's, a source, or in no folder."""
    place = args.out
    suffix = os.path.splitext(place)[1].lower()
    if suffix not in suffixes:
        raise InvalidArgument(f"--out: {place!r} must end in one of {', '.join(suffixes)}")
    check_place("--out", place, suffix)
    for source in sources:
        if os.path.exists(source) and os.path.exists(place) and os.path.samefile(source, place):
            raise InvalidArgument(f"--out: {place!r} is what is read: give another file")
    folder = os.path.dirname(os.path.abspath(place))
    if not os.path.isdir(folder):
        raise InvalidArgument(f"--out: there is no folder {folder!r}: make it first, or give another place")


def _solids(args: argparse.Namespace, progress: Callable, *places: str) -> list[list]:
    """The solids of each file (`collide.scenes.scene_solids.PlacedSolid`)."""
    from collide.scenes import load
    from collide.scenes.scene_solids import solids_of, without

    scenes = []
    for place in places:
        with progress(f"reading {place}"):
            options = {name: getattr(args, name) for name in ("meshes", "missing_meshes", "package_path", "scale")}
            scenes.append(load(place, **{name: value for name, value in options.items() if value is not None}))
    return [solids_of(scene, args.tolerance) for scene in without(scenes, args.without)]


def _moved(solid, numbers: list[float] | None):
    """A solid with its scene moved to a pose of three or six numbers."""
    from collide import pose

    if numbers is None:
        return solid
    return solid._replace(X_WS=pose(numbers[:3], rpy=numbers[3:] or None) @ solid.X_WS)


def _box(mesh, numbers: list[float] | None):
    """Two corners of the box for free space."""
    import numpy as np

    if numbers is not None:
        return np.array(numbers).reshape(2, 3)
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.1 * float((high - low).max())
    return np.stack([low - margin, high + margin])


def _about(mesh) -> dict:
    return {
        "facets": len(mesh.faces), "vertices": len(mesh.vertices), "volume": mesh.volume, "area": mesh.area,
        "centroid": mesh.centroid.tolist(),
    }


def _nothing(args: argparse.Namespace, name: str, about: dict) -> int:
    if args.json:
        write_json(about.items(), args.json)
    if args.json != "-" and not args.quiet:
        print(f"{name} is empty: nothing was written")
    return 1


def _finish(args: argparse.Namespace, name: str, mesh, about: dict, more: list[str], progress: Callable) -> None:
    """The summary, the JSON and the page."""
    if args.json:
        write_json({"out": args.out, **about}.items(), args.json)
    if about.get("crossing"):
        more = [*more, f"{count(about['crossing'], 'pair')} of facets cross after rounding"]
    summary = f"{name}: {count(about['facets'], 'facet')}, {volume(about['volume'])}, {', '.join(more)}"
    if args.html:
        _write_page(args, name, mesh, summary, progress)
    if "-" not in (args.json, args.html) and not args.quiet:
        print(f"{args.out}: {summary}; {os.path.getsize(args.out) / 1000:.0f} kB")


def _write_page(args: argparse.Namespace, name: str, mesh, summary: str, progress: Callable) -> None:
    """The result to look at, in the page of a report; no pair is tested."""
    import numpy as np

    from collide.reports import report
    from collide.reports.state_reports import Stated
    from collide.scenes.description import Scene, SceneBody

    scene = Scene(name, [SceneBody(name, mesh, np.eye(4), source=args.out)], notes=[summary])
    cli_pages.write_report(args, [Stated("", scene, report.make(scene), None)], progress)


def _stem(place: str) -> str:
    return os.path.basename(place).split(".")[0]
