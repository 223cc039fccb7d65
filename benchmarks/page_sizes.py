"""How large pages are, and how long they take to write beside the report that they show.

    python benchmarks/page_sizes.py                # a minute
    python benchmarks/page_sizes.py --runs 5

Scenes: both shipped ones with what their robots look like, 1,000 meshes of 524 facets each, no two of them the same,
1,000 bodies that share one mesh, and one mesh of 500,000 facets, which is drawn with fewer. ``report`` is the time of
the report itself, ``page`` of drawing, contacts and writing after it; medians.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from collide import Cylinder, Mesh, Sphere, pose, tessellate
from collide.errors import CollideError
from collide.pages.page_file import page_pieces, write_page
from collide.pages.report_page import report_blocks
from collide.reports import report
from collide.reports.state_reports import Stated
from collide.scenes import Scene, SceneBody, load
from collide.scenes.loaders.visual_shapes import visual_shapes

CLEARANCE = 0.05


def crowd(shared: bool) -> Scene:
    """1,000 cans in a cube, a hand's breadth apart; shared : of one mesh, else each with bumps of its own."""
    draw = np.random.default_rng(23)
    vertices, faces = tessellate(Cylinder(0.4, 0.9), tolerance=0.4 * (1 - np.cos(np.pi / 128)))
    smooth_can = Mesh(vertices, faces)
    return Scene("crowd", [
        SceneBody(
            f"can_{k}", smooth_can if shared else Mesh(vertices * (1 + 0.05 * draw.random((len(vertices), 1))), faces),
            pose((k % 10, k // 10 % 10, k // 100)),
        )
        for k in range(1000)
    ])  # fmt: skip


def large() -> Scene:
    mesh = Mesh(*tessellate(Sphere(0.5), tolerance=5.9e-6))
    return Scene("large", [SceneBody("ball", mesh, np.eye(4)), SceneBody("marble", Sphere(0.1), pose((2, 0, 0)))])


SCENES: dict[str, Callable[[], Scene]] = {
    "workcell": lambda: load("workcell"),
    "panda_workbench": lambda: load("panda_workbench"),
    "1,000 meshes": lambda: crowd(False),
    "1,000 bodies, one mesh": lambda: crowd(True),
    "one large mesh": large,
}


def measured(scene: Scene, runs: int) -> tuple[float, float, int, int, int]:
    """Seconds of the report and of its page, bytes, facets in the scene's shapes before and in the page."""
    of_report, of_page = [], []
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder, "page.html")
        for _ in range(runs):
            start = time.perf_counter()
            made = report.make(scene, clearance=CLEARANCE)
            middle = time.perf_counter()
            looks = visual_shapes(scene)
            blocks = report_blocks([Stated("", scene, made)], looks.shapes, looks.notes)
            write_page(page_pieces(scene.name, blocks), str(place))
            of_report.append(middle - start)
            of_page.append(time.perf_counter() - middle)
        size = place.stat().st_size
    shapes = next(block.data["shapes"] for block in blocks if block.id == "drawing")
    before = sum(shape["simplified_from"] or shape["triangle_count"] for shape in shapes)
    drawn = sum(shape["triangle_count"] for shape in shapes)
    return statistics.median(of_report), statistics.median(of_page), size, before, drawn


def rows(runs: int) -> Iterator[str]:
    for name, build in SCENES.items():
        try:
            scene = build()
        except CollideError as error:
            yield f"| {name} | {error} |"
            continue
        of_report, of_page, size, before, drawn = measured(scene, runs)
        yield (
            f"| {name} | {len(scene.bodies)} | {before:,} | {drawn:,} | {of_report:.2f} | {of_page:.2f} "
            f"| {size / 1e6:.1f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=3, help="of which the median is printed (3)")
    args = parser.parse_args()
    print("| scene | bodies | facets | drawn | report [s] | page [s] | MB |")
    print("| --- |" + " ---: |" * 6)
    for row in rows(args.runs):
        print(row, flush=True)


if __name__ == "__main__":
    main()
