"""The pages written by commands: ``--html`` of report, check and compare.

Imports the standard library alone, as `cli` does; the makers of pages are imported on request.
"""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Callable

from collide.cli.files import check_place
from collide.errors import CollideError, InvalidArgument, cut


def add_argument(parser) -> None:
    """``--html``, for a command whose result can be looked at."""
    parser.add_argument("--html", metavar="FILE|-",
                        help="write a page to look at: one .html file that opens in any browser, offline; or - for "
                             "standard output")


def add_glb_argument(parser) -> None:
    """``--glb``, for a command with a report on a scene."""
    parser.add_argument("--glb", metavar="FILE",
                        help="write the scene as binary glTF, bodies in the colours of their verdicts; of several "
                             "states the first")


def write_glb(place: str, stated, progress: Callable) -> None:
    """The scene of a report (`collide.reports.state_reports.Stated`) as binary glTF."""
    from collide.base.whole_file import whole_file
    from collide.pages.scene_glb import scene_glb

    with progress("writing the scene"), whole_file(place) as file:
        file.writelines(scene_glb(stated.scene, stated.report))


def check_page_place(place: str) -> None:
    """Refuse, before any work is done, a place that no page can be written to.

    Raises InvalidArgument for a folder, for a file of another kind, and where the folder of the file does not exist.
    """
    if place == "-":
        return
    if os.path.isdir(place):
        inside = os.path.join(place, "page.html")
        raise InvalidArgument(f"--html: {place!r} is a folder: give a file in it, such as {inside!r}")
    check_place("--html", place, ".html")
    folder = os.path.dirname(os.path.abspath(place))
    if not os.path.isdir(folder):
        raise InvalidArgument(f"--html: there is no folder {folder!r}: make it first, or give another place")


def write_report(args, made: list, progress: Callable) -> None:
    """The page of a report, of one state or several (`collide.reports.state_reports.Stated`)."""
    from collide.pages.report_page import report_blocks

    _write(args, made[0].scene.name, progress, lambda looks: report_blocks(made, looks.shapes, looks.notes), made)


def blocks_of_report(args, made: list) -> list:
    """The data of the page of a report, for a page that is not written to a file."""
    from collide.pages.report_page import report_blocks

    looks = _looks(args, made[0].scene)
    return report_blocks(made, looks.shapes, looks.notes)


def write_check(args, made: list, checks: list, progress: Callable) -> None:
    """The page of a check: its reports, and what counts as a collision in each of them."""
    from collide.pages.report_page import report_blocks

    _write(
        args, made[0].scene.name, progress, lambda looks: report_blocks(made, looks.shapes, looks.notes, checks), made
    )


def write_comparison(args, scene, comparison, progress: Callable) -> None:
    """The page of a comparison, with the verdicts of collide's own report."""
    from collide.pages.report_page import comparison_blocks
    from collide.reports import report
    from collide.reports.state_reports import Stated

    ours = report.make(scene, clearance=args.clearance)

    def blocks(looks):
        return comparison_blocks(scene, comparison.to_dict(), ours, looks.shapes, looks.notes)

    _write(args, scene.name, progress, blocks, [Stated("", scene, ours)])


def write_audit(args, robot, bodies: dict, published: dict, links: list, place: str, progress: Callable) -> None:
    """The page of an audit of spheres or other convex pieces: links, their pieces, and what of links is outside
    (`AuditedLink`).   place : what is audited.
    """
    from collide.pages.audit_page import audit_blocks
    from collide.pages.page_file import page_pieces, write_page
    from collide.reports.checking import Finding
    from collide.reports.sphere_report import audit_words, audited_kind
    from collide.scenes.sphere_scene import pieces_of, sphere_scene

    with progress("writing the page"):
        scene, looks = sphere_scene(robot, bodies, published, links)
        kind, out = audited_kind(links), [link for link in links if not link.encloses]
        findings = [
            Finding("outside", link.link, pieces_of(link.link, kind), -link.audit.outside[1] if link.audit else None)
            for link in out
        ]
        blocks = audit_blocks(scene, looks, findings, audit_words(robot.name, place, links), kind)
        write_page(page_pieces(f"collide spheres: {robot.name} beside {place}", blocks), args.html)


def _write(args, name: str, progress: Callable, blocks: Callable, made: list) -> None:
    from collide.pages.page_file import page_pieces, write_page

    with progress("writing the page"):
        title = f"collide {args.command}: {name}"
        write_page(page_pieces(title, blocks(_looks(args, made[0].scene))), args.html)


def _looks(args, scene):
    """What the bodies look like (`collide.scenes.loaders.visual_shapes.Looks`); a scene read anew stands for hulls."""
    from collide.cli import scenes as cli_scenes
    from collide.reports.progress import silent
    from collide.scenes.loaders.visual_shapes import visual_shapes

    whole, unread = None, []
    if (args.meshes or "mesh").startswith(("hull", "pieces")) and any(body.approximation for body in scene.bodies):
        try:
            whole = cli_scenes.load_states(Namespace(**{**vars(args), "meshes": "mesh"}), silent)[0][1]
        except CollideError as error:
            unread.append(f"meshes are drawn as tested, for they cannot be read as they are: {cut(str(error), 300)}")
    looks = visual_shapes(scene, whole=whole, package_path=args.package_path or ())
    looks.notes += unread
    return looks
