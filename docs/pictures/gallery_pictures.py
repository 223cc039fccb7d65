"""The pictures of docs/gallery.md: each scene's page in a headless browser, its 3D view as a small PNG.

    python docs/pictures/gallery_pictures.py                 # all of them, to docs/pictures/gallery-NAME.png
    python docs/pictures/gallery_pictures.py ring stack      # these alone
    python docs/pictures/gallery_pictures.py ring --pages .  # its page to look at, ring.html, and no picture

Needs Chromium with its driver, and: pip install ".[demo]" selenium pillow
"""

from __future__ import annotations

import argparse
import importlib.util
import io
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import collide
from collide.adapters.live.scene_of_world import scene_of_world
from collide.cli.main import main as command
from collide.pages.page_file import page_pieces, write_page
from collide.pages.report_page import report_blocks
from collide.reports import report
from collide.reports.state_reports import Stated
from collide.scenes import generate

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures"
WIDTH, LARGEST = 720, 60_000
FLAGS = (
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--hide-scrollbars", "--window-size=1500,760",
)


class Entry(NamedTuple):
    """A picture: arguments of ``collide report`` or a World, what is selected (a link), what is done before it.

    keys : buttons to press.   drag : how far the camera goes around the scene [pixels].
    element : class of the element that is photographed.
    """

    arguments: tuple[str, ...] = ()
    world: Callable[[], collide.World] | None = None
    link: str = ""
    keys: tuple[str, ...] = ()
    drag: int = 0
    element: str = "canvas-frame"
    clearance: float = 0.02


def ring() -> collide.World:
    """A pin in the hole of a ring, and another in its wall."""
    n = 96
    angles = 2 * np.pi * np.arange(n) / n
    section = np.array([(0.08, -0.02), (0.12, -0.02), (0.12, 0.02), (0.08, 0.02)])
    vertices = np.array([(r * np.cos(a), r * np.sin(a), z) for a in angles for r, z in section])
    i, k = (axis.ravel() for axis in np.mgrid[0:n, 0:4])
    a, b, c, d = 4 * i + k, 4 * i + (k + 1) % 4, 4 * ((i + 1) % n) + k, 4 * ((i + 1) % n) + (k + 1) % 4
    world = collide.World()
    world.add(collide.Mesh(vertices, np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])), name="ring")
    world.add(collide.Capsule(0.02, 0.16), name="pin in the hole")
    world.add(collide.Capsule(0.02, 0.16), collide.pose((-0.1, 0, 0.03)), name="pin in the wall")
    return world


def dance() -> collide.World:
    """The World of examples/21_look_at_a_world.py as it stands at 9 s."""
    spec = importlib.util.spec_from_file_location("look_at_a_world", ROOT / "examples" / "21_look_at_a_world.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.dance(9.0)


ENTRIES = {
    "workbench": Entry(("panda_workbench", "--clearance", "2cm")),
    "pair": Entry(("panda_workbench", "--clearance", "2cm"), link="#pair=panda_leftfinger|parcel"),
    "workcell": Entry(("workcell", "--clearance", "2cm"), drag=200),
    "hulls": Entry(
        ("panda_workbench", "--meshes", "hull"), link="#body=panda_hand", keys=("tested",),
    ),
    "humanoid": Entry(("examples/scenes/humanoid.yaml", "--clearance", "2cm")),
    "two-arms": Entry(
        ("examples/scenes/two_arms.yaml", "--trajectory", "examples/scenes/two_arms_plan.csv", "--clearance", "2cm"),
        link="#state=67", element="scene-side",
    ),
    "clutter": Entry(world=lambda: generate("clutter").world()),
    "stack": Entry(world=lambda: generate("stack").world(), clearance=0.001),
    "accordions": Entry(world=lambda: generate("accordions", strings=12).world()),
    "ring": Entry(world=ring, keys=("section",)),
    "dance": Entry(world=dance, clearance=0.03),
}


def write(name: str, entry: Entry, place: Path) -> None:
    """The page of an entry."""
    if entry.world is None:
        if command(["report", *entry.arguments, "--html", str(place), "--quiet"]) != 0:
            sys.exit(f"{name}: no report")
        return
    scene = scene_of_world(entry.world(), name)
    made = [Stated("", scene, report.make(scene, clearance=entry.clearance))]
    write_page(page_pieces(name, report_blocks(made, {})), str(place))


def photograph(browser, page: Path, entry: Entry) -> bytes:
    """The 3D view of a page as PNG."""
    browser.get("about:blank")
    browser.get(page.as_uri() + entry.link)
    settle(browser)
    for key in entry.keys:
        (button,) = (b for b in browser.find_elements("css selector", "#tools button") if b.text == key)
        button.click()
    if entry.drag:
        from selenium.webdriver import ActionChains

        canvas = browser.find_element("id", "canvas")
        ActionChains(browser).drag_and_drop_by_offset(canvas, entry.drag, 0).perform()
    settle(browser)
    return browser.find_element("class name", entry.element).screenshot_as_png


def settle(browser) -> None:
    """Wait until the camera stands still."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        time.sleep(0.6)
        if browser.execute_script("return window.collideViewer !== undefined && !collideViewer.measures().flying"):
            browser.execute_script("collideViewer.renderNow()")
            return
    sys.exit("the page does not come to rest")


def small(png: bytes) -> bytes:
    """The picture at the gallery's width, in as many colours as its size allows; narrower where 64 are too many."""
    from PIL import Image

    whole = Image.open(io.BytesIO(png)).convert("RGB")
    for width in (WIDTH, WIDTH * 5 // 6):
        picture = whole.resize((width, round(whole.height * width / whole.width)), Image.Resampling.LANCZOS)
        for colors in (256, 128, 64):
            file = io.BytesIO()
            # an octree keeps rare colours; others lose the few orange pixels, which are what the picture is about
            reduced = picture.quantize(colors, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
            reduced.save(file, "PNG", optimize=True)
            if file.tell() <= LARGEST:
                return file.getvalue()
    sys.exit(f"a picture takes more than {LARGEST} bytes")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[[], *ENTRIES], help="which pictures (all)")
    parser.add_argument("--out", type=Path, default=PICTURES, help="the folder they go to (docs/pictures)")
    parser.add_argument("--pages", type=Path, metavar="FOLDER", help="write pages there, and no pictures")
    args = parser.parse_args()
    if args.pages is not None:
        for name in args.names or ENTRIES:
            write(name, ENTRIES[name], args.pages / f"{name}.html")
        return
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    with tempfile.TemporaryDirectory() as folder:
        for flag in (*FLAGS, f"--user-data-dir={folder}/profile"):
            options.add_argument(flag)
        browser = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
        try:
            for name in args.names or ENTRIES:
                page = Path(folder) / f"{name}.html"
                write(name, ENTRIES[name], page)
                picture = small(photograph(browser, page, ENTRIES[name]))
                (args.out / f"gallery-{name}.png").write_bytes(picture)
                print(f"{name:12} page {page.stat().st_size / 1e6:.2f} MB, picture {len(picture) / 1e3:.1f} kB")
        finally:
            browser.quit()


if __name__ == "__main__":
    main()
