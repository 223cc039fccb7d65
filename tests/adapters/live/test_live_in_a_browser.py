"""A live page in a real browser: bodies, tables and the selection follow the World, and say when they no longer do."""

from __future__ import annotations

import time

import page_browser
import pytest

import collide
import collide.adapters


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    with page_browser.browser(tmp_path_factory.mktemp("live")) as pages:
        yield pages


@pytest.fixture
def world():
    world = collide.World()
    world.add(collide.Box((2, 1, 0.1)), name="table", static=True)
    world.add(collide.Sphere(0.1), collide.pose((0, 0, 0.5)), name="<b>ball</b>")
    world.add(collide.Box((0.2, 0.2, 0.2)), collide.pose((0.5, 0, 0.5)), name="part")
    return world


@pytest.fixture
def viewer(world):
    with collide.adapters.view(world, clearance=0.02) as viewer:
        yield viewer


def text_of(identity: str) -> str:
    return f"document.getElementById('{identity}').textContent"


def shows(pages, identity: str, words: str) -> None:
    """Wait until an element says these words."""
    pages.wait(f"return {text_of(identity)}.includes(arguments[0])", words)


def open_page(pages, viewer, link: str = "") -> None:
    pages.driver.get("about:blank")
    pages.logs()
    pages.driver.get(viewer.url + link)
    shows(pages, "live-state", "● live")
    pages.wait("return document.documentElement.dataset.ready === 'true'")


def complaints(pages, viewer) -> list[str]:
    """What the console says, and requests to anybody else than the viewer; a browser asks for an icon of its own."""
    lines = pages.logs()
    assert sum(line.startswith(viewer.url) for line in lines) >= 2, "requests for page and events are seen"
    return [line for line in lines if not line.startswith(viewer.url) and "favicon.ico" not in line]


def test_tables_scene_and_label_follow_the_world(pages, world, viewer):
    open_page(pages, viewer)
    assert "no collision" in pages.run("return " + text_of("verdict"))
    before = pages.driver.get_screenshot_as_png()
    world.set_pose("<b>ball</b>", collide.pose((0, 0, 0.1)))
    viewer.update("t = <i>1</i>")
    shows(pages, "verdict", "1 collision")
    assert pages.run("return " + text_of("live-label")) == "t = <i>1</i>"
    (row,) = pages.texts("#table-colliding tbody tr")
    assert "<b>ball</b>" in row and "50.000 mm" in row
    assert pages.driver.get_screenshot_as_png() != before
    world.set_pose("<b>ball</b>", collide.pose((0, 0, 0.16)))
    viewer.update()
    shows(pages, "verdict", "1 within")
    assert complaints(pages, viewer) == []


def test_a_selected_pair_stays_selected_with_its_new_numbers(pages, world, viewer):
    world.set_pose("part", collide.pose((0.5, 0, 0.1)))
    viewer.update()
    open_page(pages, viewer, "#pair=table|part")
    shows(pages, "caption", "50.000 mm")
    pages.wait("return !collideViewer.measures().flying")
    camera = pages.measures()["camera"]
    world.set_pose("part", collide.pose((0.5, 0, 0.12)))
    viewer.update()
    shows(pages, "caption", "30.000 mm")
    assert pages.measures()["camera"] == camera
    assert "pair=table%7Cpart" in (link := pages.driver.current_url) or "pair=table|part" in link
    world.set_pose("part", collide.pose((0.5, 0, 0.6)))
    viewer.update()
    pages.wait(f"return !{text_of('caption')}.includes('mm')")  # numbers that hold no more go away
    assert "part" in pages.run("return " + text_of("caption"))
    world.set_pose("part", collide.pose((0.5, 0, 0.11)))
    viewer.update()
    shows(pages, "caption", "40.000 mm")
    assert complaints(pages, viewer) == []


def test_other_bodies_load_the_page_again_and_the_camera_stays(pages, world, viewer):
    """In the world, that is: the scene's own origin is the middle of its bodies, and a body far away moves it."""
    open_page(pages, viewer)
    pages.click('[aria-keyshortcuts="3"]')
    pages.wait("return !collideViewer.measures().flying")
    before = pages.measures()
    assert before["bodies"] == 3
    world.add(collide.Sphere(0.1), collide.pose((9.9, 0, 0)), name="far away")
    viewer.update()
    pages.wait("return window.collideViewer && collideViewer.measures().bodies === 4")
    after = pages.measures()
    # the box around all goes from −1 … 1 to −1 … 10 along x, from −0.05 … 0.6 to −0.1 … 0.6 along z
    for name in ("camera", "target"):
        moved = [a - b for a, b in zip(after[name], before[name])]
        assert max(abs(m - expected) for m, expected in zip(moved, (-4.5, 0, 0.025))) < 1e-6, (name, before, after)
    assert complaints(pages, viewer) == []


def test_the_page_says_that_it_is_no_longer_live(pages, world, viewer):
    open_page(pages, viewer)
    viewer.close()
    shows(pages, "live-state", "no longer live")
    time.sleep(1.3)  # a page that asked again would have done so by now
    assert complaints(pages, viewer) == []


def test_what_a_world_refuses_stands_on_the_page(pages, world, viewer):
    open_page(pages, viewer)
    state = viewer._server.state
    viewer._server.show(Refusing(state))
    shows(pages, "problem", "<script> cannot be tested")
    viewer.update()
    pages.wait("return document.getElementById('problem').hidden")
    assert complaints(pages, viewer) == []


class Refusing:
    """A moment that cannot be tested."""

    problem = None

    def __init__(self, state):
        self.drawing = state.drawing

    def update(self, since):
        raise collide.UnsupportedQuery("<script> cannot be tested")
