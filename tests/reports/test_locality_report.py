"""`collide locality`: its tables, JSON and plot, and files that it refuses."""

from __future__ import annotations

import gzip
import json

import pytest
import surfaces

import collide
from collide.cli import main as cli

ORDERS = 10


@pytest.fixture
def files(tmp_path):
    """An OFF file of a torus, and one packed."""
    pytest.importorskip("trimesh")
    vertices, faces = surfaces.torus()
    lines = ["OFF", f"{len(vertices)} {len(faces)} 0", *(" ".join(map(repr, p)) for p in vertices.tolist())]
    text = "\n".join([*lines, *(f"3 {a} {b} {c}" for a, b, c in faces.tolist())]) + "\n"
    (tmp_path / "torus.off").write_text(text)
    (tmp_path / "packed.off.gz").write_bytes(gzip.compress(text.encode()))
    return tmp_path


def test_the_command_prints_both_tables(files, capsys):
    assert cli.main(["locality", str(files / "torus.off"), str(files / "packed.off.gz")]) == 0
    out, err = capsys.readouterr()
    assert err == "" and out.startswith("LOCALITY\n") and "\n\nDISTRIBUTION" in out
    found = collide.Mesh(*surfaces.torus()).locality()
    for name in ("torus", "packed"):
        (line,) = (line for line in out.partition("DISTRIBUTION")[0].splitlines() if line.split()[:1] == [name])
        shown = line.split()[1:]
        assert (
            shown[0] == "84"
            and shown[1] == f"{found.global_stretch:.3f}"
            and shown[2] == f"{found.local_stretches[0]:.3f}"
        )


def test_the_command_writes_json_and_a_plot(files, capsys):
    pytest.importorskip("matplotlib")
    place, image = files / "out.json", files / "out.svg"
    assert cli.main(["locality", str(files / "torus.off"), "--json", str(place), "--plot", str(image), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")
    data = json.loads(place.read_text())
    found = collide.Mesh(*surfaces.torus()).locality()
    (mesh,) = data["meshes"]
    assert data["schema"] == "collide-locality/1" and data["repeated"] is False
    assert mesh["name"] == "torus" and mesh["local_stretch"] == found.local_stretches.tolist()
    assert mesh["global_stretch"] == found.global_stretch and mesh["depth_bound"] == found.depth_bound
    assert len(mesh["histogram"]["counts"]) == ORDERS and sum(mesh["histogram"]["counts"][0]) == found.in_use
    assert "<svg" in image.read_text()


@pytest.mark.parametrize("n", [1, 3])
def test_a_plot_has_a_panel_a_mesh_and_one_label_below(files, n):
    pytest.importorskip("matplotlib")
    image = files / "out.svg"
    named = [files / f"torus{k}.off" for k in range(n)]
    for place in named:
        place.write_bytes((files / "torus.off").read_bytes())
    assert cli.main(["locality", *map(str, named), "--plot", str(image), "--quiet"]) == 0
    text = image.read_text()
    assert text.count("<!-- local stretch -->") == 1
    assert text.count("<!-- σ, at most ") == text.count("<!-- σ10, at most ") == n
    assert f'height="{72 * (2.6 * n + 0.6):g}pt"' in text
    titles = [text.index(f"<!-- torus{k}: ") for k in range(n)]
    label, panels = text.index("<!-- local stretch -->"), [text.index(f'id="axes_{k + 1}"') for k in range(n)]
    assert titles == sorted(titles) and label > panels[-1]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("absent.ply", "no such file"),
        ("note.txt", "unknown mesh format"),
        ("cut.off.gz", "gzip"),
        ("points.off", "has no facets"),
    ],
)
def test_the_command_refuses_in_one_line(files, capsys, name, words):
    (files / "note.txt").write_text("hello")
    (files / "cut.off.gz").write_bytes((files / "packed.off.gz").read_bytes()[:100])
    (files / "points.off").write_text("OFF\n1 0 0\n0 0 0\n")
    assert cli.main(["locality", str(files / name)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith("collide: error: ") and words in err


def test_a_plot_of_no_known_kind_is_refused_first(files, capsys):
    pytest.importorskip("matplotlib")
    assert cli.main(["locality", str(files / "torus.off"), "--plot", str(files / "plot.txt")]) == 2
    assert "must end in one of" in capsys.readouterr().err
