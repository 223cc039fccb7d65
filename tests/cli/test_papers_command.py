"""`collide papers`: every structure says what it came to; figures that a reader can work out are those."""

from __future__ import annotations

import json

import pytest

from collide.cli import main as cli
from collide.cli.papers_command import STRUCTURES


def test_each_paper_is_listed_with_its_structures(capsys):
    assert cli.main(["papers"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if not line.startswith(" ")] == ["barba-langerman", "erickson", "barba-mulzer"]
    assert len(lines) == 3 + len(STRUCTURES)
    assert max(map(len, lines)) <= 120, max(lines, key=len)
    assert sum("proof checked" in line for line in lines) == 6


def test_figures_of_the_plank_and_the_boxes(capsys):
    """The longest edge of a box is a diagonal of its largest side; two unit boxes half apart hold 1.5."""
    assert cli.main(["papers", "--paper", "erickson", "--json", "-"]) == 0
    found = {row["structure"]: row["found"] for row in json.loads(capsys.readouterr().out)["structures"]}
    stretch = (10.0**2 + 1.0**2) ** 0.5 / 0.1
    assert f"global stretch {stretch:.3g}, " in found["measures of locality"]
    assert "have volume 1.5 " in found["booleans of polyhedra"]


@pytest.mark.parametrize("given", ["walk", ""])
def test_other_papers_are_refused(given, capsys):
    assert cli.main(["papers", "--paper", given]) == 2
    assert "invalid choice" in capsys.readouterr().err
