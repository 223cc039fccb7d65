"""The command ``collide spheres``: its arguments, and its work. Imports the standard library alone before the run."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable

from collide.base.whole_file import write_whole
from collide.cli import pages as cli_pages
from collide.cli.files import write_json
from collide.cli.numbers import count
from collide.cli.srdf import load_options, robot_of
from collide.errors import InvalidArgument
from collide.reports.number_format import parse_length

#: What --audit takes in place of a file: a robot's own meshes as hulls, or as unions of convex pieces.
_FORMS = ("hull", "pieces")

EPILOG = """examples:
  collide spheres robot.urdf --out spheres.urdf              8 spheres a link
  collide spheres robot.urdf --out spheres.urdf --excess 10mm
  collide spheres robot.urdf --out spheres.urdf --total 60
  collide spheres robot.urdf --audit published_spheres.urdf
  collide spheres robot.urdf --audit published_spheres.urdf --html page.html
  collide spheres robot.urdf --audit hull                    or pieces, or F.urdf

Makes spheres whose union contains the collision geometry of each link, with
a proof that is checked in integers, for planners that take robots as spheres.
What such a planner finds free is free for the meshes, too. --out writes the
robot's URDF with these spheres in place of its collision elements; all else
in the file stays as it is.

--count takes so many spheres for each link, --total so many for the robot,
shared where they help most, --excess as few as found that go beyond no link
by more. docs/spheres.md says how they are placed and proven.

--audit tells, link by link, what a published set leaves outside: the share
of the link's surface, its greatest distance from the spheres, and how far the
spheres exceed the link. Every number has proven bounds. --html shows links,
spheres and what lies outside. The set may as well be of boxes, cylinders and
other convex shapes; its meshes are taken as their convex hulls. --audit hull
and --audit pieces judge what --meshes hull and --meshes pieces would put in
place of ROBOT's own meshes.

ROBOT is a URDF, MJCF or SDFormat file, or a scene (a file or a shipped one)
with a robot in it; --out needs a URDF.

exit status: 0 made, or all is inside; 1 something lies outside; 2 error"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("robot", metavar="ROBOT", help="a URDF, MJCF or SDFormat file, or a scene with a robot in it")
    parser.add_argument("--name", metavar="NAME", help="which robot, of a scene with several")
    how_many = parser.add_mutually_exclusive_group()
    how_many.add_argument("--count", type=count, metavar="N", help="spheres for each link, at most (8)")
    how_many.add_argument("--total", type=count, metavar="N", help="spheres for all links together, at most")
    how_many.add_argument("--excess", type=_length, metavar="D",
                          help="as few as go beyond no link by more: 0.01 (metres), 10mm, 1cm")
    how_many.add_argument("--audit", metavar="F.urdf|hull|pieces",
                          help="judge a robot of spheres or other convex shapes, links by their names; or the "
                               "hulls, or the convex pieces, of the robot's own meshes")
    parser.add_argument("--out", metavar="F.urdf", help="write the URDF with the spheres")
    parser.add_argument("--force", action="store_true", help="let --out overwrite a file")
    parser.add_argument("--meshes", choices=("mesh", "hull", "pieces"),
                        help="how meshes enter: as they are (default), as convex hulls, or as unions of convex pieces")
    parser.add_argument("--missing-meshes", choices=("error", "skip"), help="what to do about missing mesh files")
    parser.add_argument("--package-path", action="append", metavar="DIR", help="where package:// is looked for")
    parser.add_argument("--json", metavar="FILE|-", help="write JSON to a .json file, or - for standard output")
    parser.add_argument("--quiet", action="store_true", help="no table, no progress; errors are still told")
    cli_pages.add_argument(parser)


def run(args: argparse.Namespace, progress: Callable) -> bool:
    """Whether all of the robot is in the spheres; of spheres made, True."""
    _check_out(args)
    if args.audit is None and args.html is not None:
        raise InvalidArgument("--html: shows an audit: give --audit F.urdf, or --out F.urdf here and audit that file")
    with progress("reading the robot"):
        robot = robot_of(args.robot, args.name, load_options(args) | {"srdf": False})
        bodies = _bodies(robot)
    return _audit(args, robot, bodies, progress) if args.audit else _make(args, robot, bodies, progress)


def _bodies(robot) -> dict:
    """Link → its collision geometry as a body in the frame of the link."""
    from collide import Compound

    bodies = {
        link: Compound([(part.shape, part.X_LG) for part in parts]) for link, parts in robot.geometry.items() if parts
    }
    if not bodies:
        raise InvalidArgument(f"{robot.place}: no link has collision geometry to put spheres around")
    return bodies


# --- making -------------------------------------------------------------------------------------


def _make(args: argparse.Namespace, robot, bodies: dict, progress: Callable) -> bool:
    from collide.reports import sphere_report
    from collide.spheres.enclosing_spheres import enclosing_spheres

    counts = _counts(args, bodies, progress)
    made = []
    for link, body in bodies.items():
        with progress(f"spheres around {link}"):
            asked = {"excess": args.excess} if args.excess is not None else {"count": counts[link]}
            made.append(sphere_report.MadeLink(link, enclosing_spheres(body, **asked)))
    if args.out:
        write_whole(args.out, _text(robot, made))
    if args.json:
        write_json(sphere_report.made_items(robot.name, made).items(), args.json)
    _print(args, sphere_report.made_table(made), sphere_report.made_words(robot.name, made), robot)
    return True


def _counts(args: argparse.Namespace, bodies: dict, progress: Callable) -> dict[str, int | None]:
    if args.total is None:
        return dict.fromkeys(bodies, args.count)
    if args.total < len(bodies):
        raise InvalidArgument(f"--total: {len(bodies)} links need a sphere each at least, got {args.total}")
    from collide.spheres.body_facets import Reach, body_parts
    from collide.spheres.place_spheres import sampled, shared_counts

    with progress("sharing spheres among links"):
        samples = [sampled(Reach(body_parts(body))) for body in bodies.values()]
        return dict(zip(bodies, shared_counts(samples, args.total)))


def _text(robot, made: list) -> str:
    from pathlib import Path

    from collide.reports.number_format import brief_length
    from collide.scenes.sphere_urdf import LinkSpheres, with_spheres

    links = {}
    for link, spheres in made:
        name = link.removeprefix(robot.prefix)
        beyond = brief_length(float(f"{spheres.excess[1]:.4g}"))
        comment = f"spheres that contain the link, proven; at most {beyond} beyond it: collide"
        links[name] = LinkSpheres(spheres.centers, spheres.radii, comment)
    return with_spheres(Path(robot.sources[0]), links).decode()


def _check_out(args: argparse.Namespace) -> None:
    """Before the work, not after it: the places of both URDFs."""
    if args.out is None:
        return
    if args.audit is not None:
        raise InvalidArgument("--out: an audit makes no spheres; leave out --audit, or --out")
    if not args.out.lower().endswith(".urdf"):
        raise InvalidArgument(f"--out: {args.out!r} must end in .urdf")
    if not args.robot.lower().endswith(".urdf"):
        raise InvalidArgument(f"--out: writes a URDF with other collision elements, and {args.robot} is none")
    if os.path.exists(args.out) and not args.force:
        raise InvalidArgument(f"--out: {args.out} exists: --force overwrites it")


# --- auditing -----------------------------------------------------------------------------------


def _audit(args: argparse.Namespace, robot, bodies: dict, progress: Callable) -> bool:
    from collide import Sphere, audit_pieces
    from collide.reports import sphere_report

    with progress("reading what is audited"):
        published, place = _published(args, robot, bodies)
    links = []
    for link, body in bodies.items():
        pieces = published.get(link)
        with progress(f"auditing {link}"):
            audit = audit_pieces(body, pieces) if pieces is not None else None
        shapes = _leaves(pieces) if pieces is not None else []
        n_spheres = sum(isinstance(shape, Sphere) for shape in shapes)
        links.append(sphere_report.AuditedLink(link, n_spheres, len(shapes), audit))
    if args.json:
        write_json(sphere_report.audit_items(robot.name, place, links).items(), args.json)
    if args.html:
        cli_pages.write_audit(args, robot, bodies, published, links, place, progress)
    words = sphere_report.audit_words(robot.name, place, links)
    _print(args, sphere_report.audit_table(links, place), words, robot)
    return all(link.encloses for link in links)


def _published(args: argparse.Namespace, robot, bodies: dict) -> tuple[dict, str]:
    """(link → the convex pieces in the frame of the link, what they are called) of another robot, or of the robot with
    its meshes as hulls or pieces.
    """
    from collide import Compound

    if args.audit in _FORMS:
        others = robot_of(args.robot, args.name, load_options(args) | {"srdf": False, "meshes": args.audit})
        place = f"{robot.name} with meshes as {args.audit.removesuffix('s')}s"
    else:
        others = robot_of(args.audit, None, {"srdf": False, "missing_meshes": "skip", "meshes": "hull"})
        place = os.path.basename(args.audit)
    if not any(link in bodies for link, parts in others.geometry.items() if parts):
        raise InvalidArgument(f"--audit: {args.audit} and {robot.place} share no link with collision geometry")
    pieces = {
        link: Compound([(part.shape, part.X_LG) for part in parts]) for link, parts in others.geometry.items() if parts
    }
    return pieces, place


def _leaves(shape) -> list:
    """The shapes of a compound, of compounds in it as well."""
    from collide import Compound

    return [leaf for item, _ in shape.items for leaf in _leaves(item)] if isinstance(shape, Compound) else [shape]


# --- printing -----------------------------------------------------------------------------------


def _print(args: argparse.Namespace, table, words: str, robot) -> None:
    if "-" in (args.json, args.html) or args.quiet:
        return
    from collide.reports import terminal
    from collide.reports.tables import wrapped

    width, _ = terminal.output_width(sys.stdout)
    terminal.write_text("\n".join(wrapped(words, width)) + "\n\n")
    terminal.show_table(table)
    for link in robot.missing_meshes:
        terminal.write_text("\n".join(wrapped(f"note: left out, its mesh was not found: {link}", width)) + "\n")


def _length(text: str) -> float:
    try:
        value = parse_length(text, "the excess")
    except InvalidArgument as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    if value == 0.0:
        raise argparse.ArgumentTypeError(f"must be above 0, got {text!r}")
    return value
