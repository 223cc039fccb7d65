"""The script of the page: built of its sources, without markup made of text, its colours told apart."""

from __future__ import annotations

import hashlib
import itertools
import json
import re

import numpy as np
import pytest

from collide.pages.body_verdicts import ORDER
from collide.pages.page_file import VIEWER

SOURCES = sorted((VIEWER / "source").glob("*.js"))
#: Severe deficiency of red and of green receptors, in linear colours (Machado, Oliveira, Fernandes 2009, table 1).
NO_RED = ((0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216), (-0.003882, -0.048116, 1.051998))
NO_GREEN = ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413), (-0.011820, 0.042940, 0.968881))


def test_bundle_is_built_of_the_sources():
    digest = hashlib.sha256()
    for source in SOURCES:
        digest.update(f"{source.name}\n".encode() + source.read_bytes())
    with open(VIEWER / "bundle.js", encoding="utf-8") as file:
        first = file.readline()
    assert digest.hexdigest() in first, "bundle.js is stale: npm run build in collide/pages/viewer"
    versions = json.loads((VIEWER / "package.json").read_text(encoding="utf-8"))["devDependencies"]
    assert all(f"{name} {version}" in first for name, version in versions.items())


def test_bundle_keeps_the_licence_of_what_it_holds():
    assert "Copyright 2010-" in (VIEWER / "bundle.js").read_text(encoding="utf-8")
    assert "The MIT License" in (VIEWER / "LICENSE").read_text(encoding="utf-8")


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.name)
def test_sources_make_no_markup_of_text_and_ask_no_server(source):
    text = source.read_text(encoding="utf-8")
    forbidden = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|\bfetch\(|XMLHttpRequest"
    assert not re.search(forbidden, text)
    assert ("EventSource" in text) == (source.name == "live_page.js"), "only a live page is connected"
    assert len(text.splitlines()) <= 400 and text.startswith("/**")


def channel(value: float) -> float:
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def linear(color: str) -> np.ndarray:
    return np.array([channel(int(color[k : k + 2], 16) / 255) for k in (1, 3, 5)])


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of linear sRGB, white D65."""
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    ratio = to_xyz @ np.clip(rgb, 0, 1) / (0.9505, 1.0, 1.089)
    x, y, z = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16 / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def looks() -> dict[str, tuple[str, str, str]]:
    """Verdict → colour, pattern, sign of verdicts.js."""
    text = (VIEWER / "source" / "verdicts.js").read_text(encoding="utf-8").split("PAIR_CLASSES")[0]
    found = re.findall(r'"?([a-z ]+?)"?: \{ color: "(#\w{6})", pattern: (\d), sign: "(.)"', text)
    return {name.strip(): look for name, *look in found}


def test_every_verdict_has_a_look_of_its_own():
    made = looks()
    assert set(made) == set(ORDER)
    for k in range(3):
        assert len({look[k] for look in made.values()}) == len(ORDER), "colour, pattern and sign are each its own"


@pytest.mark.parametrize("eye", [np.eye(3), NO_RED, NO_GREEN], ids=["all receptors", "no red", "no green"])
def test_verdicts_are_told_apart_by_their_colours_too(eye):
    seen = {name: lab(np.array(eye) @ linear(look[0])) for name, look in looks().items()}
    for a, b in itertools.combinations(seen, 2):
        difference = float(np.linalg.norm(seen[a] - seen[b]))
        assert difference > 12.0, f"{a} and {b} look alike: {difference:.1f}"


def themes() -> list[dict[str, str]]:
    """The custom properties of every theme of the style."""
    style = (VIEWER / "page.css").read_text(encoding="utf-8")
    blocks = re.findall(r"\{([^{}]*--paper:[^{}]*)\}", style)
    return [dict(re.findall(r"--(\w+): (#\w{6});", block)) for block in blocks]


def test_text_is_read_on_its_ground_in_every_theme():
    """Contrast of 4.5 : 1 (WCAG 2.2, 1.4.3)."""
    weights = (0.2126, 0.7152, 0.0722)
    made = themes()
    assert len(made) == 3 and made[1] == made[2], "the dark of the system is the dark of the button"
    for theme in made:
        for ink, ground in itertools.product(("ink", "soft", "accent"), ("paper", "panel")):
            bright, dark = sorted((float(linear(theme[key]) @ weights) for key in (ink, ground)), reverse=True)
            assert (bright + 0.05) / (dark + 0.05) >= 4.5, f"{ink} {theme[ink]} on {ground} {theme[ground]}"
