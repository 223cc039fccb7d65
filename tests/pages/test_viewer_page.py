"""The page in a real browser: it opens without a request, follows clicks, keys and links, and hides nothing."""

from __future__ import annotations

import itertools
import json
import queue
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import quote

import numpy as np
import pytest
from drawn_data import CLASSES, body, box, drawing_of, grid_shape, packed, pair, report_of
from page_browser import PageBrowser, browser

from collide.pages.page_file import DataBlock, page_pieces
from collide.pages.report_page import report_blocks
from collide.reports import report
from collide.reports.state_reports import Stated
from collide.scenes import load

CLEARANCE = 0.1
HOSTILE = [
    "<script>window.hacked = 1</script>", "<img src=x onerror='window.hacked = 1'>", "</script><b>bold",
    'quote " and \' ', "two\nlines\tand a tab", "\u202eright to left\u202c", "שלום", "%7C|&state=9#pair=",
    "long " + "name " * 2000, "half a pair \ud800",
    "{{constructor}}`${1}`", "javascript:alert(1)", "__proto__",
]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    with browser(tmp_path_factory.mktemp("browser")) as made:
        yield made


@pytest.fixture(scope="module")
def workcell(page):
    """(page of the shipped scene, its report as data)"""
    scene = load("workcell")
    made = report.make(scene, clearance=CLEARANCE)
    blocks = report_blocks([Stated("", scene, made)], {})
    drawing = next(block.data for block in blocks if block.id == "drawing")
    return page.write("workcell", report=made.to_dict(), drawing=drawing), made.to_dict()


def small(page: PageBrowser, name: str, names=("first", "second", "third"), **blocks):
    """A page of three boxes in a row: the first two overlap by 0.5 m, the third is 0.25 m away."""
    a, b, c = names
    bodies = [body(a, (0, 0, 0), "colliding"), body(b, (1.5, 0, 0), "colliding"), body(c, (3.75, 0, 0), "near")]
    data = report_of(name, colliding=[pair(a, b, -0.5, (1, 0, 0))], near=[pair(b, c, 0.25, (2.5, 0, 0))])
    return page.write(name, report=data, drawing=drawing_of([box(1.0)], bodies), **blocks)


def selected(page: PageBrowser) -> str:
    return page.run("return document.getElementById('caption').textContent")


def link(page: PageBrowser) -> str:
    return page.run("return decodeURIComponent(location.hash)")


# --- it opens, and tells everything ---------------------------------------------------------------


def test_it_opens_without_requests_or_errors_and_draws_all_bodies(page, workcell):
    place, data = workcell
    page.open(place)
    measures = page.measures()
    assert measures["bodies"] == data["scene"]["bodies"] and measures["triangles"] > 1000
    assert measures["calls"] <= 10, "bodies are one draw call, grid, axes and edges a few more"
    assert page.run("return performance.getEntriesByType('resource').length") == 0
    assert page.logs() == []


def test_tables_hold_every_row_of_the_report(page, workcell):
    place, data = workcell
    page.open(place)
    for name in ("colliding", "touching", "near"):
        rows = page.run(
            "return [...document.querySelectorAll(`#table-${arguments[0]} tbody tr`)].map((row) =>"
            " [...row.cells].slice(0, 2).map((cell) => cell.textContent))", name,
        )
        assert data[name] and rows == [[row["a"], row["b"]] for row in data[name]]
    assert len(page.texts("#table-bodies tbody tr")) == data["scene"]["bodies"]
    assert len(page.texts("#table-proofs tbody tr")) == len(data["proofs"])


def test_the_page_hides_nothing(page):
    page.open(small(page, "all"))
    text = page.run("return document.querySelector('main').textContent")
    for told in (
        "surface of 8 facets", "hull of a mesh", "two surfaces without an end",
        "SRDF: Adjacent: links that a joint connects", "4 of 10 pairs; nothing is claimed",
        "a formula for this pair of shapes", "joint 4 is outside its limits", "all.yaml",
        "ignored A and ignored B", "500 mm", "library, v4", "1.00 s", "250 ms", "convex pairs", "from a later version",
        "one mesh drawn with fewer facets",
    ):
        assert told in text, told


def test_every_control_has_a_name_and_headings_are_there(page):
    page.open(small(page, "names"))
    nameless = page.run(
        "return [...document.querySelectorAll('button, input, select')].filter((node) => !(node.textContent.trim() ||"
        " node.getAttribute('aria-label') || node.closest('label'))).length")
    assert nameless == 0
    assert len(page.texts("h1")) == 1 and len(page.texts("main")) == 1
    assert page.run("return [...document.querySelectorAll('th')].every((head) => head.scope === 'col')")
    page.press(["\ue004"])
    first = page.run("return document.activeElement.textContent")
    assert first == "to the tables", "the first stop leads past the scene"


# --- selection ------------------------------------------------------------------------------------


def test_a_row_moves_the_camera_and_unfolds_its_numbers(page, workcell):
    place, data = workcell
    page.open(place)
    before = page.measures()
    row = data["colliding"][0]
    page.click("#table-colliding .row-button")
    after = page.measures()
    target = np.array(after["target"]) - before["target"]
    assert np.linalg.norm(np.subtract(after["camera"], before["camera"])) > 0.05 and np.linalg.norm(target) > 0.01
    assert row["a"] in selected(page) and row["b"] in selected(page) and "colliding" in selected(page)
    (detail,) = page.texts("#tables .detail")
    bracket = re.search(r"proven in \[(\S+) m, (\S+) m\]", detail)
    assert [float(bracket[1]), float(bracket[2])] == [row["lower"], row["upper"]], "every digit of the bracket"
    sentence = next(proof["sentence"] for proof in data["proofs"] if proof["how"] == row["how"])
    assert sentence in detail and after["calls"] > before["calls"], "marks are drawn"
    assert link(page) == f"#pair={row['a']}|{row['b']}"


def test_an_overlap_between_two_depths_is_not_called_open(page):
    """Of bodies that are not convex: colliding, at most so deep, at least so deep. Only an undecided row is open."""
    known = {"certified": False, "lower": -0.5, "how": "exact arithmetic"}
    rows = [
        pair("first", "second", -0.5, (1, 0, 0)) | known | {"upper": -0.125},
        pair("first", "third", -0.5, (1, 0, 0)) | known | {"upper": 0.0},
        pair("second", "third", -1e-9, (1, 0, 0)) | known | {"upper": 1e-9, "lower": -1e-9, "how": "undecided"},
    ]
    bodies = [body(name, (x, 0, 0), "colliding") for x, name in enumerate(("first", "second", "third"))]
    place = page.write(
        "depths", report=report_of("depths", colliding=rows), drawing=drawing_of([box(1.0)], bodies)
    )
    details = []
    for a, b in (("first", "second"), ("first", "third"), ("second", "third")):
        page.open(place, f"#pair={a}|{b}")
        details.append(page.texts("#tables .detail")[0])
    assert "at most 500.000 mm deep, at least 125.000 mm deep" in details[0] and "open" not in details[0]
    assert "at most 500.000 mm deep, at least 0.000 mm deep" in details[1] and "open" not in details[1]
    assert "the sign is open" in details[2] and "at most" not in details[2]


def test_the_picture_shows_the_pair(page):
    """Pixels: ghosts are paler than bodies, and the move that parts the pair is drawn in its own colour."""
    place = small(page, "pixels")
    page.open(place, "#pair=first|second")
    page.measures()
    move = page.run("return getComputedStyle(document.getElementById('canvas')).getPropertyValue('--move').trim()")
    count = page.run("""
        collideViewer.renderNow();
        const canvas = document.getElementById('canvas');
        const copy = document.createElement('canvas');
        [copy.width, copy.height] = [canvas.width, canvas.height];
        const context = copy.getContext('2d');
        context.drawImage(canvas, 0, 0);
        const pixels = context.getImageData(0, 0, copy.width, copy.height).data;
        const wanted = [1, 3, 5].map((k) => parseInt(arguments[0].slice(k, k + 2), 16));
        let n = 0;
        for (let k = 0; k < pixels.length; k += 4) n += wanted.every((c, i) => Math.abs(pixels[k + i] - c) < 12);
        return n;""", move)
    assert count > 100, "the arrow of the separating translation"
    assert {"A", "B", "normal A→B", "500.000 mm"} <= set(page.texts("#labels .tag"))


def test_keys_walk_through_the_rows(page):
    page.open(small(page, "keys"))
    page.press("j")
    assert "first and second" in selected(page)
    page.press("jj")
    assert "second and third" in selected(page)
    page.press("k")
    assert "odd A and odd B" in selected(page), "a pair without an answer is a row, too"
    page.press(["\ue00c"])
    assert selected(page) == "" and link(page) == ""
    page.press("?")
    assert page.run("return document.getElementById('keys').open")
    page.press("?")
    before = page.measures()["camera"]
    page.press("3")
    assert page.measures()["camera"] != before
    page.press("w")
    page.press("c")
    assert page.texts("#tools [aria-pressed=true]") == ["ghosts", "tested", "section"]
    assert page.run("return collideViewer.measures().calls") > 0 and page.logs() == []


def test_the_picture_turns_by_keys_where_it_has_the_focus(page):
    page.open(small(page, "arrows"))
    page.run("document.getElementById('canvas').focus()")

    def look():
        measures = page.measures()
        offset = np.subtract(measures["camera"], measures["target"])
        return np.array(measures["target"]), np.linalg.norm(offset), np.arctan2(offset[1], offset[0]), offset[2]

    target, distance, heading, height = look()
    page.press("\ue014")
    turned = look()
    assert np.isclose(turned[2] - heading, np.pi / 24) and np.isclose(turned[1], distance), "a step to the right"
    page.press("\ue013")
    assert look()[3] > height and np.allclose(look()[0], target), "a step upwards"
    page.press("+")
    assert np.isclose(look()[1], 0.8 * distance)


def test_a_link_opens_the_view_again(page, workcell):
    place, data = workcell
    row = data["near"][1]
    page.open(place, f"#pair={quote(row['a'])}|{quote(row['b'])}")
    opened = page.measures()
    assert f"{row['a']} and {row['b']}" in selected(page) and len(page.texts("#tables .detail")) == 1
    other = data["touching"][0]["a"]
    page.run("location.hash = 'body=' + encodeURIComponent(arguments[0])", other)
    page.wait("return document.querySelector('#card h2')?.textContent === arguments[0]", other)
    assert page.measures()["camera"] != opened["camera"]
    page.open(place, "#pair=no|such")
    assert "no row of this page is about no and such" in selected(page)


def test_a_click_on_a_body_lists_its_rows(page):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    page.open(small(page, "click"), "#body=second")
    page.measures()
    page.run("collideViewer.select(null)")
    assert page.run("return document.getElementById('card').hidden")
    canvas = page.driver.find_element(By.ID, "canvas")
    ActionChains(page.driver, duration=0).move_to_element(canvas).pause(0.1).perform()
    page.wait("return !document.getElementById('hover').hidden")
    assert page.texts("#hover .name") == ["second"], "names on hover"
    ActionChains(page.driver, duration=0).click(canvas).perform()
    assert page.texts("#card h2") [0] == "second" and link(page) == "#body=second"
    assert [text for text in page.texts("#card td.name") if text != "second"] == ["first", "third"]


# --- filters, tables ------------------------------------------------------------------------------


def test_filters_filter_and_say_what_they_hide(page, workcell):
    place, data = workcell
    page.open(place)
    pairs = [row for name in ("colliding", "touching", "near") for row in data[name]]

    def listed():
        return sum(len(page.texts(f"#table-{name} tbody tr.choice")) for name in ("colliding", "touching", "near"))

    name = data["near"][0]["b"]
    wanted = sum(name in row["a"] or name in row["b"] for row in pairs)
    page.enter("#filter-name", name.upper())
    assert 0 < wanted < len(pairs) and listed() == wanted
    assert f"{len(pairs) - wanted} hidden by filters" in page.texts("#filters [role=status]")[0]
    page.enter("#filter-name", "")
    page.enter("#filter-clearance", 40)
    nearer = sum(row["distance"] <= 0.4 * CLEARANCE for row in data["near"])
    assert 0 < nearer < len(data["near"]) and listed() == len(pairs) - len(data["near"]) + nearer
    page.enter("#filter-clearance", 100)
    page.enter("#filter-depth", 1e3 * data["colliding"][0]["depth"] + 1)
    assert listed() == len(pairs) - len(data["colliding"])
    page.run("[...document.querySelectorAll('.chip')].find((chip) => chip.textContent.includes('touching')).click()")
    assert listed() == len(data["near"])
    page.click("#filters .status-line button")
    assert listed() == len(pairs)


def test_a_hundred_thousand_rows_stay_usable(page):
    n = 100_000
    row = json.dumps(pair("left 0", "right 0", -1.0), separators=(",", ":"))
    data = report_of("many", colliding=[json.loads(row)])
    bodies = [body("left 0", (0, 0, 0), "colliding"), body("right 0", (1, 0, 0), "colliding")]
    place = page.write("many", report=data, drawing=drawing_of([box(1.0)], bodies))
    # made of the text of one row: the writer of pages is not what is tested here
    numbered = row.replace("%", "%%").replace("left 0", "left %d").replace("right 0", "right %d")
    rows = (numbered.replace('"depth":1.0', f'"depth":{1 + 1e-6 * k}') % (k, k) for k in range(n))
    text = place.read_text(encoding="utf-8")
    assert text.count(row) == 1
    place.write_text(text.replace(row, ",".join(rows)), encoding="utf-8")
    page.open(place)
    assert len(page.texts("#table-colliding tbody tr")) == 50
    assert "of 100,000 rows" in page.texts("#table-colliding .pager")[0]
    page.click("#table-colliding .pager button", 3)
    assert page.texts("#table-colliding tbody tr:last-child td")[0] == f"left {n - 1}"
    page.enter("#filter-name", "right 77777")
    assert page.texts("#table-colliding tbody tr td:nth-child(2)") == ["right 77777"]
    page.enter("#filter-name", "")
    page.click("#table-colliding th button", 2)
    assert page.texts("#table-colliding th[aria-sort]") == ["depth ▲"]
    assert page.texts("#table-colliding tbody tr td")[0] == "left 0"


def test_a_thousand_bodies_of_half_a_million_facets_are_few_draw_calls(page):
    n, side = 1000, 10
    shapes = [grid_shape(16, seed) for seed in range(n)]
    bodies = [body(f"body {k}", np.array([k % side, k // side % side, k // side**2]), "free", k) for k in range(n)]
    place = page.write("large", report=report_of("large"), drawing=drawing_of(shapes, bodies))
    page.open(place)
    measures = page.measures()
    assert measures["triangles"] >= 500_000 and measures["bodies"] == n
    assert measures["calls"] <= 50, measures
    drawn = measures["pictures"]
    page.run("return new Promise((done) => setTimeout(done, 200))")
    assert page.run("return collideViewer.measures().pictures") == drawn, "no picture is made where nothing changed"


# --- names, states, windows, paper ------------------------------------------------------------------


def test_hostile_names_stay_text(page):
    bodies = [body(name, (2.5 * k, 0, 0), "colliding", note=name, owner=name) for k, name in enumerate(HOSTILE)]
    rows = [pair(a, b, -0.5) for a, b in itertools.pairwise(HOSTILE)]
    data = report_of(HOSTILE[0], colliding=rows)
    data["notes"] = HOSTILE
    place = page.write("hostile", report=data, drawing=drawing_of([box(1.0)], bodies))
    page.open(place)
    page.press("j" * 3)
    for k, name in enumerate(HOSTILE):
        page.click("#table-bodies .row-button", k)
        whole = page.texts("#card h2 .name")[0]
        seen = {"\n": "\\n", "\t": "\\t", "\u202e": "\\u202e", "\u202c": "\\u202c", "\ud800": "\\ud800"}
        assert whole == "".join(seen.get(c, c) for c in name)
    page.open(place, f"#pair={quote(HOSTILE[7])}|{quote(HOSTILE[8])}")
    assert "%7C|&state=9#pair=" in selected(page), "a name that looks like a link"
    assert page.run("return window.hacked") is None and page.logs() == []
    assert page.run("return document.querySelectorAll('img, b, iframe, object, main script').length") == 0
    assert page.run("return document.documentElement.scrollWidth <= innerWidth")


#: What a page says of samples that it has, as `collide.pages.drawn_states` writes it.
SAMPLES = "5 of 2001"


def states_page(page: PageBrowser, proof: dict | None = None, known=None):
    """Two boxes, the second coming nearer in five states; the pair's row is of the worst of them.

    known : what the page knows of the gaps, None where nothing.
    """
    gaps = [0.5, 0.25, 0.0, -0.5, 0.125]
    classes = ["free", "near", "touching", "colliding", "near"]
    poses = np.zeros((5, 1, 3, 4))
    poses[:, 0, :, :3] = np.eye(3)
    poses[:, 0, 0, 3] = [2 + gap for gap in gaps]
    rows = []
    for gap, verdict, clearance in zip(gaps, classes, known or gaps):
        entry = {"verdict": verdict, "clearance": clearance, "left_out": 0, **{name: [] for name in CLASSES}}
        if verdict != "free":
            entry[verdict] = [[0, 1, gap, gap, gap]]
        rows.append(entry)
    states = {
        "labels": [f"sample {k}" for k in range(5)], "shares": [0, 0.25, 0.5, 0.75, 1],
        "times": [0, 0.1, 0.2, 0.3, 0.4], "moving": [1],
        "poses": packed(poses, "<f4"), "rows": rows, "samples": SAMPLES,
        "body_verdicts": [[] if verdict == "free" else [[0, verdict], [1, verdict]] for verdict in classes],
    }
    at = {"share": 0.75, "time": None, "sample": 3, "waypoint": 0}
    worst = {**pair("still", "mover", -0.5, (1, 0, 0)), "at": at, "from": at, "samples": 1, "state": {"joint": 0.1}}
    data = report_of("states")
    data["trajectory"] = {
        "certified": False, "source": "plan.csv", "waypoints": 2, "samples": 5, "resolution": 0.02, "duration": None,
        "moving": ["mover"], "collides": True, "first_collision": worst, "least": worst, "colliding": [worst],
        "shallow": [], "touching": [], "near": [], "unanswered": [], "notes": [],
    }
    if proof is not None:
        data["trajectory"]["proof"] = proof
    bodies = [body("still", (0, 0, 0), "free", static=True), body("mover", (2.5, 0, 0), "free")]
    return page.write("states", report=data, drawing=drawing_of([box(1.0)], bodies, states))


def test_states_move_the_bodies_and_tell_their_verdicts(page):
    page.open(states_page(page), "#state=1")
    assert page.run("return collideViewer.measures().state") == 1
    assert f"samples shown: {SAMPLES}; nothing is certified" in page.texts("#states .remark")[0]
    assert "sample 1 (2 of 5)" in page.texts(".state-label")[0] and "250.000 mm" in page.texts(".state-label")[0]
    assert page.texts("#table-seen td.name") == ["still", "mover"]
    place = "return collideViewer.placeOf('mover').map((c) => Math.round(1000 * c) / 1000)"
    assert page.run(place) == [2.25, 0, 0]
    page.enter("#states input[type=range]", 2)
    assert page.run(place) == [2, 0, 0] and page.texts("#table-bodies td .verdict")[0].endswith("touching")
    page.click("#table-path-colliding .row-button")
    assert page.run(place) == [1.5, 0, 0] and link(page) == "#pair=still|mover&state=3"
    assert len(page.texts("#states rect")) == 5 and len(page.texts("#states path")) == 1
    page.press("[[")
    assert page.run(place) == [2.25, 0, 0] and selected(page) == "", "numbers of another state are not shown"
    page.click("#states .play")
    page.wait("return collideViewer.measures().state === 4")
    assert page.run(place) == [2.125, 0, 0] and page.texts("#states .play") == ["▶ play"]
    page.open(page._folder / "states.html", "#pair=still|mover&state=3")
    assert page.run(place) == [1.5, 0, 0] and "depth 500.000 mm" in selected(page)


@pytest.mark.parametrize(
    ("known", "caption"),
    [
        ([0.5, 0.25, 0.0, -0.5, 0.125],
         "signed distance of the nearest pair from -500.000 mm to 500.000 mm; below the line bodies overlap"),
        ([0.5, 0.25, 0.02, 0.03, 0.125], "least clearance from 20.000 mm to 500.000 mm"),
        ([0.5, None, 0.0, None, 0.125], "least clearance from 0.000 mm to 500.000 mm, without a number in 2 states"),
        ([0.004] * 5, "least clearance 4.000 mm in every state"),
        ([None, None, 0.004, None, None], "least clearance 4.000 mm in every state, without a number in 4 states"),
        ([0.0] * 5, "least clearance 0.000 mm in every state"),
        ([None] * 5, "samples shown"),
    ],
)
def test_the_curve_is_told_in_words_whatever_is_known(page, known, caption):
    page.open(states_page(page, known=known))
    (remark,) = page.texts("#states .remark")
    assert remark.startswith(f"{caption}; samples shown" if caption[0] != "s" or known[0] else caption), remark
    assert "undefined" not in page.run("return document.querySelector('main').textContent") and "NaN" not in remark


def test_two_states_stand_side_by_side(page):
    page.open(states_page(page), "#state=3")
    page.press("h")
    assert page.measures()["second"] == 3 and page.texts("#second .caption") == ["sample 3 ✕colliding"]
    page.press("[")
    measures = page.measures()
    assert (measures["state"], measures["second"]) == (2, 3), "the second picture keeps its state"
    widths = page.run("return [...document.querySelectorAll('.pictures canvas')].map((c) => c.clientWidth)")
    assert len(widths) == 2 and abs(widths[0] - widths[1]) <= 2
    page.press("h")
    assert page.measures()["second"] is None and page.logs() == []


@pytest.mark.parametrize(("width", "height"), [(1000, 500), (1600, 420), (500, 1000)])
@pytest.mark.parametrize("link", ["#pair=first|second", "#pair=second|third"])
def test_the_camera_frames_both_bodies_of_a_pair(page, width, height, link):
    page.open(small(page, "framed"), link, width=width, height=height)
    page.wait("return !collideViewer.measures().flying")
    page.measures()
    frame = page.run("const f = document.querySelector('.canvas-frame'); return [f.clientWidth, f.clientHeight]")
    for name in link[6:].split("|"):
        corners = np.array(page.run("return collideViewer.cornersOf(arguments[0])", name))
        assert len(corners) == 8 and (corners >= 0).all() and (corners <= frame).all(), (name, corners, frame)


def test_labels_lie_on_no_badge_and_on_no_other_label(page, workcell):
    place, data = workcell
    for row in data["colliding"][:2] + data["near"][:2]:
        page.open(place, f"#pair={quote(row['a'])}|{quote(row['b'])}")
        page.wait("return !collideViewer.measures().flying")
        page.measures()
        boxes = page.run(
            "return [...document.querySelectorAll('#labels .tag:not([hidden])')].map((n) => n.getBoundingClientRect())"
            ".map((r) => [r.left, r.top, r.right, r.bottom])")
        badges = page.run("return [...document.querySelectorAll('#labels .tag:not([hidden])')].map((n) => "
                          "n.classList.contains('badge'))")
        assert len(boxes) >= 4 and sum(badges) == 2
        for (a, of_a), (b, of_b) in itertools.combinations(zip(boxes, badges), 2):
            meet = a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
            assert not meet or (of_a and of_b), (row["a"], row["b"], a, b)


def test_frames_of_robots_are_drawn_on_request(page):
    links = [body(f"link {k}", (k, 0, 0), "free", owner="arm") for k in range(1, 4)]
    bodies = [body("still", (0, 0, 0), "free"), *links]
    page.open(page.write("frames", report=report_of("frames"), drawing=drawing_of([box(0.4)], bodies)))
    assert page.measures()["frames"] == 0
    page.press("r")
    assert page.measures()["frames"] == 3, "of what robots carry"
    page.run("collideViewer.select('still')")
    assert page.measures()["frames"] == 1, "of what is selected"
    page.press("r")
    assert page.measures()["frames"] == 0


def test_a_picture_is_saved_as_png(page):
    page.open(small(page, "saved"))
    name, start, size = page.run("""
        let made = null;
        document.createElement = ((create) => (tag) => {
          const node = create.call(document, tag);
          if (tag === 'a') node.click = () => { made = node; };
          return node;
        })(document.createElement);
        document.dispatchEvent(new KeyboardEvent('keydown', {key: 's'}));
        return [made.download, made.href.slice(0, 22), made.href.length];""")
    assert (name, start) == ("saved.png", "data:image/png;base64,") and size > 5000


def test_what_two_solids_share_is_told_and_drawn(page):
    corners = np.array([[-0.25, -1, -1], [0.25, -1, -1], [0, 1, 1]] * 4, dtype=float)
    overlap = {"volume": 8.410928510265143e-05, "certified": True}
    overlap |= {"origin": [0.75, 0, 0], "triangles": packed(corners, "<f4")}
    patch = {"points": [[1, -1, -1], [1, 1, -1], [1, 1, 1]], "normal": [1, 0, 0], "depths": [0.5, 0.5, 0.5]}
    entry = {"a": "first", "b": "second", "patches": [patch], "overlap": overlap}
    bare = {**entry, "overlap": None, "patches": []}
    calls = []
    for contacts in (bare, entry):
        page.open(small(page, "shared", contacts=[contacts]), "#pair=first|second")
        page.wait("return !collideViewer.measures().flying")
        calls.append(page.measures()["calls"])
    assert calls[1] >= calls[0] + 5, "the volume, the patch and an arrow at each of its points"
    assert "84.11 cm³, certified" in page.texts("#tables .detail dd")


def test_a_bound_keeps_its_sign_and_counts_say_of_what(page):
    bound = {**pair("first", "second", -0.5, (1, 0, 0)), "upper": 0.0, "lower": -0.5, "certified": False}
    bodies = [body("first", (0, 0, 0), "colliding"), body("second", (1.5, 0, 0), "colliding")]
    page.open(page.write("bound", report=report_of("bound", colliding=[bound]), drawing=drawing_of([box(1.0)], bodies)),
              "#pair=first|second")
    assert "depth ≤ 500.000 mm" in selected(page)
    counts = page.texts(".chip .count")
    assert counts[0] == "2 bodies" and set(counts[1:]) == {"no body"}
    assert page.texts("#table-colliding .count") == ["1 pair"] and page.texts("#table-bodies .count") == ["2 bodies"]
    page.enter("#filter-name", "nobody")
    assert page.texts("#table-colliding .count") == ["0 of 1 pair"]
    assert page.texts("#table-colliding .pager") == ["the filters hide it"]


def test_volumes_of_overlaps_stand_in_a_table(page):
    small, large = {"a": "x", "b": "y", "volume": 2e-9}, {"a": "p", "b": "q", "volume": 0.5}
    data = report_of("volumes") | {"overlaps": [small, large]}
    page.open(page.write("volumes", report=data, drawing=drawing_of([box(1.0)], [])))
    assert page.texts("#table-overlaps td.number") == ["0.5 m³", "2 mm³"]
    assert "overlaps" not in "".join(page.texts("#table-further td"))


def test_a_column_has_one_unit(page):
    rows = [pair(f"a{k}", f"b{k}", gap) for k, gap in enumerate((2e-6, 3.5e-4, 0.02))]
    page.open(page.write("units", report=report_of("units", near=rows), drawing=drawing_of([box(1.0)], [])))
    cells = page.run("return [...document.querySelectorAll('#table-near tbody tr')].map((r) => r.cells[2].textContent)")
    assert cells == ["0.00200 mm", "0.350 mm", "20.000 mm"]


@pytest.mark.parametrize("n", [0, 1, 50, 2000])
@pytest.mark.parametrize(("width", "height"), [(1400, 900), (1000, 500), (390, 800)])
def test_reports_of_any_length_fit_the_window(page, n, width, height):
    names = [f"part {k}" for k in range(n + 1)]
    rows = [pair(a, b, -0.01 * (k + 1)) for k, (a, b) in enumerate(itertools.pairwise(names))]
    bodies = [body(name, (2.1 * k, 0, 0), "colliding" if n else "free") for k, name in enumerate(names)]
    place = page.write("length", report=report_of("length", colliding=rows), drawing=drawing_of([box(1.0)], bodies))
    page.open(place, width=width, height=height)
    assert page.run("return document.documentElement.scrollWidth <= innerWidth") and page.logs() == []
    assert page.texts("#table-colliding .count") == ([f"{n:,} pair{'s' * (n != 1)}"] if n else [])
    assert "undefined" not in page.run("return document.querySelector('main').textContent")


def test_a_proof_is_a_band_under_the_verdicts(page):
    """A quarter of the path is proven, a quarter open, the rest sampled alone."""
    proof = {
        "robot": "r", "why": None, "clearance": 0.0, "free": False, "share": 0.25, "first_collision": None,
        "proven": [[0.0, 0.25]], "open": [{"a": "still", "b": "mover", "begin": 0.25, "end": 0.5}], "checked": 9,
        "text": "25 % of the path is proven free; 1 interval stays open",
    }
    page.open(states_page(page, proof))
    parts = page.run(
        "return [...document.querySelectorAll('#states rect.proof')].map((r) => [r.getAttribute('class'), "
        "Number(r.getAttribute('x')), Number(r.getAttribute('width')), r.textContent])"
    )
    assert [part[:3] for part in parts] == [
        ["proof sampled", 0, 1000], ["proof proven", 0, 250], ["proof open", 250, 250]
    ]
    assert parts[2][3] == "not proven, still and mover: 25 % to 50 % of the path"
    remark = page.texts("#states .remark")[0]
    assert proof["text"] in remark and "nothing is certified" not in remark
    assert any(proof["text"] in text for text in page.texts("#table-path td"))


def test_several_states_have_tables_and_contacts_of_their_own(page):
    reports = [
        report_of("home", near=[pair("still", "mover", 0.25, (1, 0, 0))]),
        report_of("goal", colliding=[pair("still", "mover", -0.5, (1, 0, 0))]),
    ]
    poses = np.zeros((2, 1, 3, 4))
    poses[:, 0, :, :3] = np.eye(3)
    poses[:, 0, 0, 3] = 2.25, 1.5
    both = (("near", 0.25), ("colliding", -0.5))
    rows = [{"verdict": verdict, "clearance": gap, "left_out": 0} for verdict, gap in both]
    states = {
        "labels": ["home", "goal"], "shares": None, "times": None, "moving": [1], "poses": packed(poses, "<f4"),
        "rows": rows, "samples": None, "body_verdicts": [[[row, verdict] for row in range(2)] for verdict, _ in both],
    }
    data = {
        "schema": "collide-states/1", "verdict": {"text": "1 of 2 states collides", "collides": True},
        "states": [{"name": name, "report": each} for name, each in zip(("home", "goal"), reports)],
    }
    bodies = [body("still", (0, 0, 0), "near"), body("mover", (2.25, 0, 0), "near")]
    patch = {"points": [[1, -1, -1], [1, 1, -1], [1, 1, 1]], "normal": [1, 0, 0], "depths": [0.5, 0.5, 0.5]}
    contacts = [{"a": "still", "b": "mover", "state": 1, "patches": [patch], "overlap": None}]
    page.open(page.write("several", report=data, drawing=drawing_of([box(1.0)], bodies, states), contacts=contacts))
    assert page.texts("#table-states td:first-child") == ["home", "goal"]
    page.click("#table-near .row-button")
    assert "contacts" not in page.texts("#tables .detail dt") and not page.texts("#table-colliding")
    page.click("#table-states .row-button", 1)
    assert page.texts("#table-colliding td.name") == ["still", "mover"] and not page.texts("#table-near")
    assert page.run("return collideViewer.placeOf('mover')") == [1.5, 0, 0]
    page.click("#table-colliding .row-button")
    assert "contacts" in page.texts("#tables .detail dt") and link(page) == "#pair=still|mover&state=1"


def test_a_comparison_shows_disagreements_first(page):
    dispute = {
        "engine": "peer", "kind": "hit", "a": "first", "b": "second", "size": 1.0, "reference_hit": True,
        "reference_distance": -0.5, "hit": False, "distance": 0.125, "exact_hit": True, "exact_distance": -0.5,
        "lower": None, "upper": None, "judged_by": "exact arithmetic", "off": 0.625, "touching": None, "not_judged": "",
        "wrong": ["peer"], "proven": [], "undecided": [], "note": "",
    }
    asked = {"version": "1", "skipped": "", "asked": 3, "seconds": 0.1}
    summaries = [{"engine": name, **asked} for name in ("collide", "peer")]
    summaries.append({"engine": "absent", "version": "", "skipped": "not installed", "seconds": None})
    data = {
        "reference": "collide", "bodies": 3, "pairs": 3, "max_distance": 0.5, "tolerance": 1e-6, "summaries": summaries,
        "disagreements": [dispute], "ours_wrong": 0, "peers_wrong": 1,
    }
    ours = report_of("ours", colliding=[pair("first", "second", -0.5, (1, 0, 0))])
    bodies = [body("first", (0, 0, 0), "colliding"), body("second", (1.5, 0, 0), "colliding")]
    place = page.write("compared", report=data, ours=ours, drawing=drawing_of([box(1.0)], bodies, kind="compare"))
    page.open(place)
    first, second = page.texts("#tables summary h2")[:2]
    assert (first, second) == ("ENGINES SIDE BY SIDE", "DISAGREEMENTS")
    cells = page.texts("#table-engines-side-by-side tbody td")
    assert cells == ["first", "second", "-500.000 mm", "-500.000 mm", "125.000 mm"]
    assert "not installed" in page.texts("#table-skipped-engines")[0]
    page.click("#table-dispute-hit .row-button")
    assert "normal A→B" in page.texts("#labels .tag"), "witness points are those of collide's own answer"
    assert page.logs() == []


def test_a_narrow_window_and_dark_colours(page, workcell):
    place, _ = workcell
    page.open(place, width=420)
    assert page.run("return document.documentElement.scrollWidth") <= 420
    assert page.measures()["triangles"] > 1000
    ground = "return getComputedStyle(document.body).backgroundColor"
    light = page.run(ground)
    page.click("#theme")
    assert page.texts("#theme") == ["colours: dark"] and page.run(ground) != light


def test_paper_gets_all_rows_and_a_still(page):
    rows = [pair("first", f"row {k}", 0.1) for k in range(120)]
    bodies = [body("first", (0, 0, 0), "near")]
    place = page.write("paper", report=report_of("paper", near=rows), drawing=drawing_of([box(1.0)], bodies))
    page.open(place)
    assert len(page.texts("#table-near tbody tr")) == 50
    printed = page.run("""
        dispatchEvent(new Event('beforeprint'));
        const still = document.getElementById('still');
        const pixels = still.getContext('2d').getImageData(0, 0, still.width, still.height).data;
        const rows = document.querySelectorAll('#table-near tbody tr').length;
        dispatchEvent(new Event('afterprint'));
        return [rows, new Set(new Uint32Array(pixels.buffer)).size];""")
    assert printed[0] == 120 and printed[1] > 20, "the still is a picture"
    assert len(page.texts("#table-near tbody tr")) == 50


class _Server(ThreadingHTTPServer):
    """Serves one page, and the events put into a queue; None ends them."""

    daemon_threads = True

    def __init__(self, text: str):
        self.text, self.events = text, queue.Queue()
        super().__init__(("127.0.0.1", 0), _Handler)
        threading.Thread(target=self.serve_forever, daemon=True).start()


class _Handler(BaseHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def do_GET(self):
        events = self.path.startswith("/events")
        self.send_response(200 if events or self.path == "/" else 404)
        self.send_header("Content-Type", "text/event-stream" if events else "text/html; charset=utf-8")
        self.end_headers()
        if self.path == "/":
            self.wfile.write(self.server.text.encode())
        while events and (event := self.server.events.get()) is not None:
            name, data = event
            self.wfile.write(f"event: {name}\ndata: {json.dumps(data)}\n\n".encode())
            self.wfile.flush()


def test_a_live_page_follows_what_it_is_sent(page):
    bodies = [body("first", (0, 0, 0), "colliding"), body("second", (1.5, 0, 0), "colliding")]
    blocks = [
        DataBlock("report", report_of("live", colliding=[pair("first", "second", -0.5, (1, 0, 0))])),
        DataBlock("drawing", drawing_of([box(1.0)], bodies)), DataBlock("live", {"events": "events?token=1"}),
    ]
    server = _Server("".join(page_pieces("live", blocks, live=True)))
    try:
        page.driver.get(f"http://127.0.0.1:{server.server_port}/#pair=first|second")
        page.wait("return document.documentElement.dataset.ready === 'true'")
        before = page.measures()
        apart = report_of("live", near=[pair("first", "second", 0.25, (1, 0, 0))])
        pose = [1, 0, 0, 2.25, 0, 1, 0, 0, 0, 0, 1, 0]
        server.events.put(("update", {
            "poses": [[1, pose]], "verdicts": [[0, "near"], [1, "near"]], "report": apart, "contacts": None,
            "label": "t = 1.25 s",
        }))
        page.wait("return document.getElementById('live-mark').textContent.endsWith('t = 1.25 s')")
        assert page.run("return collideViewer.placeOf('second')") == [2.25, 0, 0]
        assert "near, distance 250.000 mm" in selected(page), "the pair stays selected, its numbers are the new ones"
        assert page.texts("#table-near td.name") == ["first", "second"] and not page.texts("#table-colliding")
        assert page.measures()["camera"] == before["camera"]
        server.events.put(("problem", {"text": "line 3: <b>no</b> such shape"}))
        page.wait("return document.getElementById('problem').textContent === 'line 3: <b>no</b> such shape'")
        server.events.put(("problem", {"text": None}))
        page.wait("return document.getElementById('problem').hidden")
        server.events.put(("closed", {}))
        page.wait("return document.getElementById('live-mark').textContent.includes('no longer live')")
    finally:
        server.events.put(None)
        server.shutdown()
        server.server_close()
