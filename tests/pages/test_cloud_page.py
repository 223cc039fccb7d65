"""Clouds in a real browser: drawn in one call a cloud, named point by point, ghosts and cuts like other bodies."""

from __future__ import annotations

import numpy as np
import pytest
from page_browser import browser

import collide
from collide.pages.page_file import page_pieces
from collide.pages.report_page import report_blocks
from collide.reports import report
from collide.reports.state_reports import Stated
from collide.scenes import Scene, SceneBody

#: Three balls in a row along x, the middle one in a box; many points behind.
BALLS = collide.PointCloud([(-1, 0, 0), (0, 0, 0), (1, 0, 0)], [0.3, 0.2, 0.1])


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("clouds")
    many = collide.PointCloud(np.random.default_rng(0).uniform((-3, 2, -2), (3, 3, 2), (20_000, 3)))
    bodies = [
        SceneBody("balls", BALLS, np.eye(4)), SceneBody("many", many, np.eye(4)),
        SceneBody("box", collide.Box((0.3, 0.3, 0.3)), collide.pose((0, 0, -0.3))),
    ]
    scene = Scene("clouds", bodies)
    blocks = report_blocks([Stated("", scene, report.make(scene))], {})
    place = folder / "clouds.html"
    place.write_text("".join(page_pieces("clouds", blocks)), encoding="utf-8")
    with browser(folder) as made:
        made.place = place
        yield made


def test_points_are_drawn_a_call_a_cloud(page):
    page.open(page.place)
    measures = page.measures()
    assert measures["points"] == 20_003 and measures["triangles"] == 12 and measures["calls"] <= 8
    assert page.logs() == []
    text = page.run("return document.querySelector('main').textContent")
    assert "2 clouds drawn, 20003 points" in text
    page.run("collideViewer.select('many')")
    facts = page.run("return document.querySelector('main').textContent")
    assert "drawn as20,000 points, off by at most 0.0000" in facts


def test_the_pair_names_the_point(page):
    page.open(page.place, "#pair=balls|box")
    (detail,) = page.texts("#tables .detail")
    assert "point 1 of A, 0 of B" in detail
    assert page.logs() == []


def test_pixels_of_balls_ghosts_and_cuts(page):
    """Counts of pixels in the colour of verdicts: ghosts are paler, and a cut takes what is beyond it."""
    count = """
        collideViewer.renderNow();
        const canvas = document.getElementById('canvas'), copy = document.createElement('canvas');
        [copy.width, copy.height] = [canvas.width, canvas.height];
        const context = copy.getContext('2d');
        context.drawImage(canvas, 0, 0);
        const p = context.getImageData(0, 0, copy.width, copy.height).data;
        let n = 0;
        for (let k = 0; k < p.length; k += 4) n += p[k] - p[k + 2] > 90 && p[k] - p[k + 1] > 40;
        return n"""
    page.open(page.place)
    page.press("1")
    whole = page.run(count)
    page.run("collideViewer.select('many')")
    ghosts = page.run(count)
    page.press("g")
    again = page.run(count)
    assert whole > 500 and ghosts < 0.1 * whole < again, (whole, ghosts, again)
    page.run("collideViewer.select(null)")
    page.press("1")
    page.press("c")  # at the middle of x: the larger part of the balls
    cut = page.run(count)
    assert 0.05 * whole < cut < 0.95 * whole, (whole, cut)
    assert page.logs() == []
