"""``collide spheres``: URDFs with spheres, tables, audits, pages, and errors in a line."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from mesh_shapes import block_ring
from page_browser import browser

import collide
from collide.cli.main import main

URDF = """<?xml version="1.0"?>
<!-- kept -->
<robot name="arm">
  <link name="base">
    <visual><geometry><box size="1 1 1"/></geometry></visual>
    <collision name="a > b">
      <origin xyz="0 0 0.5" rpy="0.3 0 0"/>
      <geometry><box size="0.4 0.2 0.6"/></geometry>
    </collision>
    <!-- between -->
    <collision><geometry><cylinder radius="0.1" length="0.5"/></geometry></collision>
    <inertial><mass value="1"/></inertial>
  </link>
  <link name="tip"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="frame"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="weld" type="fixed"><parent link="tip"/><child link="frame"/></joint>
</robot>
"""


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "arm.urdf").write_text(URDF, encoding="utf-8")
    return tmp_path / "arm.urdf"


def test_a_urdf_with_spheres_encloses_the_links_and_keeps_the_rest(robot, tmp_path, capsys):
    out = tmp_path / "spheres.urdf"
    assert main(["spheres", str(robot), "--out", str(out), "--count", "4", "--json", str(tmp_path / "made.json")]) == 0
    told = capsys.readouterr().out
    assert "5 spheres contain 2 links, proven" in told and "base" in told
    text = out.read_text(encoding="utf-8")
    collision = re.compile(r"\s*(?:<!-- spheres that contain.*?-->\s*)?<collision.*?</collision>", re.DOTALL)
    assert collision.sub("", text) == collision.sub("", URDF)  # byte for byte
    assert text.count("<sphere") == 5 and len(ET.fromstring(text)) == len(ET.fromstring(URDF))
    made = json.loads((tmp_path / "made.json").read_text(encoding="utf-8"))
    links = {link["link"]: link for link in made["links"]}
    read = collide.Robot.load(out, srdf=False)
    for name, parts in collide.Robot.load(robot, srdf=False).geometry.items():
        spheres = read.geometry[name]
        assert np.array_equal([part.X_LG[:3, 3] for part in spheres], links[name]["centers"])
        assert [part.shape.radius for part in spheres] == links[name]["radii"]
        body = collide.Compound([(part.shape, part.X_LG) for part in parts])
        made_anew = collide.enclosing_spheres(body, 4)
        assert np.array_equal(made_anew.radii, links[name]["radii"]) and list(made_anew.excess) == links[name]["excess"]
        made_anew.verify(body)
    assert main(["spheres", str(robot), "--audit", str(out)]) == 0
    assert "contains the collision geometry of arm: 2 links, proven" in capsys.readouterr().out


@pytest.mark.slow
def test_excess_and_total_are_kept(robot, capsys):
    assert main(["spheres", str(robot), "--excess", "5cm", "--json", "-"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert all(link["excess"][1] <= 0.05 for link in made["links"])
    assert main(["spheres", str(robot), "--total", "6", "--json", "-"]) == 0
    shared = json.loads(capsys.readouterr().out)
    assert sum(len(link["radii"]) for link in shared["links"]) <= 6
    counts = {link["link"]: len(link["radii"]) for link in shared["links"]}
    assert counts["tip"] == 1 < counts["base"]


def published(robot, tmp_path, radius: float):
    """One ball for the base, none for the tip."""
    text = re.sub(r"<collision.*</collision>(?=\s*<inertial)",
                  f'<collision><geometry><sphere radius="{radius}"/></geometry></collision>', URDF, flags=re.DOTALL)
    text = re.sub(r'<link name="tip">.*?</link>', '<link name="tip"/>', text)
    file = tmp_path / "published.urdf"
    file.write_text(text, encoding="utf-8")
    return file


def test_an_audit_tells_what_is_outside(robot, tmp_path, capsys):
    file, found = published(robot, tmp_path, 0.5), tmp_path / "found.json"
    assert main(["spheres", str(robot), "--audit", str(file), "--json", str(found)]) == 1
    told = capsys.readouterr().out
    assert "published.urdf does not contain arm: 2 of 2 links" in told and "no spheres" in told
    audit = json.loads(found.read_text(encoding="utf-8"))
    base, tip = audit["links"]
    # The farthest corner of the turned box: (±0.2, y, 0.5 + z).
    turned = [(0.1 * s * np.cos(0.3) - 0.3 * np.sin(0.3) * t, 0.1 * s * np.sin(0.3) + 0.3 * np.cos(0.3) * t)
              for s in (-1, 1) for t in (-1, 1)]
    far = max(np.sqrt(0.2**2 + y**2 + (0.5 + z) ** 2) for y, z in turned) - 0.5
    assert base["outside"][0] <= far <= base["outside"][1] < far + 1e-3
    assert tip == {"link": "tip", "spheres": 0, "pieces": 0, "encloses": False}
    assert not audit["encloses"] and audit["audited"] == "published.urdf"


@pytest.mark.slow
def test_pieces_of_any_convex_shapes_are_audited(robot, tmp_path, capsys):
    """A robot against itself is contained; a smaller box in the place of the base's shapes is not, by half of what it
    lacks along the box, and a mesh that is not convex enters as its hull.
    """
    assert main(["spheres", str(robot), "--audit", str(robot), "--json", "-"]) == 0
    links = json.loads(capsys.readouterr().out)["links"]
    assert [(link["pieces"], link["spheres"], link["encloses"], link["excess"]) for link in links] == [
        (2, 0, True, [0.0, 0.0]), (1, 1, True, links[1]["excess"]),
    ]
    other = tmp_path / "other.urdf"
    other.write_text(URDF.replace("0.4 0.2 0.6", "0.36 0.2 0.6"), encoding="utf-8")
    assert main(["spheres", str(robot), "--audit", str(other)]) == 1
    told = capsys.readouterr().out
    assert "PIECES OF other.urdf" in told and "other.urdf does not contain arm: 1 of 2 links" in told
    assert "by 20 mm at most (base)" in " ".join(told.split())

    vertices, faces = block_ring()
    collide.Mesh(vertices, faces).save(tmp_path / "ring.stl")
    mesh = URDF.replace('<box size="0.4 0.2 0.6"/>', '<mesh filename="ring.stl"/>').replace(" rpy=\"0.3 0 0\"", "")
    (tmp_path / "ring.urdf").write_text(mesh, encoding="utf-8")
    hole = collide.audit_pieces(collide.Mesh(vertices, faces), collide.ConvexHull(vertices)).excess
    for audited, place in (("hull", "arm with meshes as hulls"), (str(tmp_path / "ring.urdf"), "ring.urdf")):
        assert main(["spheres", str(tmp_path / "ring.urdf"), "--audit", audited, "--json", "-"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["audited"] == place and found["encloses"]
        lower, upper = found["links"][0]["excess"]
        assert 0.0 < lower <= hole[1] and hole[0] <= upper


def test_a_page_shows_pieces(robot, tmp_path):
    other, page = tmp_path / "other.urdf", tmp_path / "page.html"
    other.write_text(URDF.replace("0.4 0.2 0.6", "0.36 0.2 0.6"), encoding="utf-8")
    assert main(["spheres", str(robot), "--audit", str(other), "--html", str(page), "--quiet"]) == 1
    drawing = json.loads(re.search(r'id="drawing">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)[1])
    verdicts = {body["name"]: body["verdict"] for body in drawing["bodies"]}
    assert verdicts == {"base": "colliding", "base: pieces": "free", "tip": "free", "tip: pieces": "free"}
    assert "outside their pieces" in page.read_text(encoding="utf-8")


def test_a_page_shows_what_is_outside(robot, tmp_path):
    page = tmp_path / "page.html"
    file = published(robot, tmp_path, 0.5)
    assert main(["spheres", str(robot), "--audit", str(file), "--html", str(page), "--quiet"]) == 1
    text = page.read_text(encoding="utf-8")
    drawing = json.loads(re.search(r'id="drawing">(.*?)</script>', text, re.DOTALL)[1])
    verdicts = {body["name"]: body["verdict"] for body in drawing["bodies"]}
    assert verdicts == {"base": "colliding", "base: spheres": "free", "tip": "colliding"}
    shown = drawing["shapes"][drawing["bodies"][0]["shown"]]
    assert shown["triangle_count"] > 10 and drawing["bodies"][0]["tested"] is not None
    report = json.loads(re.search(r'id="report">(.*?)</script>', text, re.DOTALL)[1])
    (check,) = report["check"]
    assert check["fails"] and [row["a"] for row in check["findings"]] == ["base", "tip"]


@pytest.mark.slow  # a browser
def test_the_page_opens_in_a_browser(robot, tmp_path):
    page = tmp_path / "page.html"
    main(["spheres", str(robot), "--audit", str(published(robot, tmp_path, 0.5)), "--html", str(page), "--quiet"])
    with browser(tmp_path) as shown:
        shown.driver.get(page.as_uri())
        words = shown.driver.find_element("tag name", "body").text
        assert "collide spheres" in words and "does not contain arm" in words and "base: spheres" in words


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--total", "1"], "2 links need a sphere each"),
        (["--excess", "0"], "above 0"),
        (["--excess", "10 apples"], "units"),
        (["--count", "3", "--excess", "1cm"], "not allowed with"),
        (["--out", "x.txt"], "must end in .urdf"),
        (["--out", "arm.urdf"], "--force overwrites it"),
        (["--audit", "arm.urdf", "--out", "y.urdf"], "an audit makes no spheres"),
        (["--audit", "none.urdf"], "none.urdf"),
        (["--audit", "hulls"], "hulls"),
        (["--html", "page.html"], "shows an audit"),
        (["--excess", "1um"], "more than 1000 spheres"),
    ],
)
def test_errors_are_one_line(robot, tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert main(["spheres", "arm.urdf", *arguments]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.startswith("collide: error: ") and words in said


def test_a_robot_that_is_no_urdf_gets_no_urdf(tmp_path, capsys):
    assert main(["spheres", "panda_workbench", "--out", str(tmp_path / "x.urdf")]) == 2
    assert "writes a URDF" in capsys.readouterr().err


def test_other_encodings_and_missing_collisions_are_refused(tmp_path):
    from collide.errors import SceneError
    from collide.scenes.sphere_urdf import LinkSpheres, with_spheres

    spheres = LinkSpheres(np.zeros((1, 3)), np.ones(1), "one -- ball")
    file = tmp_path / "latin.urdf"
    file.write_bytes(b'<?xml version="1.0" encoding="latin-1"?><robot name="a"><link name="b"/></robot>')
    with pytest.raises(SceneError, match="latin-1"):
        with_spheres(file, {})
    file.write_text('<robot name="a"><link name="b"/><link name="c"><collision x="/>"/></link></robot>')
    with pytest.raises(SceneError, match='link "b"'):
        with_spheres(file, {"b": spheres})
    text = with_spheres(file, {"c": spheres}).decode()
    assert ET.fromstring(text).find("link[@name='c']/collision/geometry/sphere").get("radius") == "1.0"
    file.write_text("<robot")
    with pytest.raises(SceneError, match="no XML"):
        with_spheres(file, {})
