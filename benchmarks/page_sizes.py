"""How large pages are, and how long they take to write beside the report that they show.

    python benchmarks/page_sizes.py                # a minute
    python benchmarks/page_sizes.py --open         # and in a headless Chromium, which draws in software (selenium)

Scenes: both shipped ones with what their robots look like, 1,000 meshes of 524 facets each, no two of them the same,
1,000 bodies that share one mesh, one mesh of 500,000 facets, which is drawn with fewer, and a cloud of 10⁶ points, all
of them drawn. "report" is the time of the report itself, "page" of drawing, contacts and writing after it; s. With
``--open``: seconds from asking for the page until it is ready, and until its first picture stands; milliseconds a
picture while the camera moves, at 1,280 by 800 pixels; draw calls and triangles of a picture.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from collide import Cylinder, Mesh, PointCloud, Sphere, pose, tessellate
from collide.adapters.bench.claims import Claim, Options, Race, grid, main
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
    ])


def large() -> Scene:
    mesh = Mesh(*tessellate(Sphere(0.5), tolerance=5.9e-6))
    return Scene("large", [SceneBody("ball", mesh, np.eye(4)), SceneBody("marble", Sphere(0.1), pose((2, 0, 0)))])


def cloudy() -> Scene:
    """A marble in a ball-shaped room of 10⁶ points."""
    directions = np.random.default_rng(24).normal(size=(1_000_000, 3))
    cloud = PointCloud(directions / np.linalg.norm(directions, axis=1)[:, None], 0.001)
    return Scene("cloudy", [SceneBody("room", cloud, np.eye(4)), SceneBody("marble", Sphere(0.1), pose((0.3, 0, 0)))])


SCENES: dict[str, Callable[[], Scene]] = {
    "workcell": lambda: load("workcell"),
    "panda_workbench": lambda: load("panda_workbench"),
    "1,000 meshes": lambda: crowd(False),
    "1,000 bodies, one mesh": lambda: crowd(True),
    "one large mesh": large,
    "a cloud of 10^6 points": cloudy,
}


#: Moves the camera ten times; a pixel is read back, so that the picture is really there.
_ROTATION = """
const canvas = document.querySelector("canvas");
const gl = canvas.getContext("webgl2");
const pixel = new Uint8Array(4);
const shown = () => { window.collideViewer.renderNow(); gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); };
const times = [];
shown();
const first = performance.now();
for (let k = 0; k < 10; k += 1) {
  canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: k % 2 ? 40 : -40, bubbles: true, cancelable: true }));
  const start = performance.now();
  shown();
  times.push(performance.now() - start);
}
times.sort((a, b) => a - b);
return [window.collideViewer.measures(), first, times[5]];
"""


def opened(place: Path) -> dict:
    """Ready and first picture [s], a picture [ms], draw calls, triangles, in a headless browser."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.support.ui import WebDriverWait

    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--window-size=1280,800"):
        options.add_argument(argument)
    driver = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    try:
        driver.get(place.as_uri())
        ready = "return document.documentElement.dataset.ready === 'true'"
        WebDriverWait(driver, 60, poll_frequency=0.05).until(lambda browser: browser.execute_script(ready))
        measures, first, picture = driver.execute_script(_ROTATION)
    finally:
        driver.quit()
    return {"ready_s": measures["opened"] / 1e3, "first_s": first / 1e3, "picture_ms": picture,
            "draw_calls": measures["calls"], "triangles": measures["triangles"]}


def measure(options: Options, scene: str) -> Race:
    of, folder = SCENES[scene](), tempfile.TemporaryDirectory()
    place, made = Path(folder.name, "page.html"), report.make(SCENES[scene](), clearance=CLEARANCE)

    def page() -> list:
        looks = visual_shapes(of)
        blocks = report_blocks([Stated("", of, made)], looks.shapes, looks.notes)
        write_page(page_pieces(of.name, blocks), str(place))
        return blocks

    shapes = next(block.data["shapes"] for block in page() if block.id == "drawing")
    columns = {
        "bodies": len(of.bodies), "MB": place.stat().st_size / 1e6,
        "facets": sum(shape["simplified_from"] or shape["triangle_count"] for shape in shapes),
        "drawn": sum(shape["triangle_count"] for shape in shapes),
    } | (opened(place) if options.open else {})
    tasks = {"report": lambda: report.make(of, clearance=CLEARANCE), "page": page}
    return Race(tasks, columns=columns, close=folder.cleanup)


def cases(options: Options):
    return grid(scene=list(SCENES)[: 1 if options.quick else None])


def arguments(parser) -> None:
    parser.add_argument("--open", action="store_true", help="open each in a headless Chromium as well")


CLAIMS = [Claim("page_sizes", "s of reports and pages", cases, measure, unit="s", turns=3, clock=time.perf_counter)]


if __name__ == "__main__":
    main(__doc__, CLAIMS, arguments)
