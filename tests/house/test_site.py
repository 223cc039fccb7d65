"""The site that Sphinx makes of docs/: built without a warning, whole, and with nothing fetched by a reader."""

from __future__ import annotations

import html.parser
import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import collide
import collide.scenes

ROOT = Path(__file__).resolve().parents[2]
NEEDED = ("sphinx", "myst_parser", "furo")


class Page(html.parser.HTMLParser):
    """The ids of a page, what it links to, and what a browser loads to show it."""

    def __init__(self, text: str):
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = {name: value or "" for name, value in attributes}
        self.ids |= {values[name] for name in ("id", "name") if name in values}
        if tag in ("script", "img", "iframe", "source") and "src" in values:
            self.loaded.append(values["src"])
        elif tag == "link" and values.get("rel") in ("stylesheet", "icon", "preload", "preconnect", "dns-prefetch"):
            self.loaded.append(values.get("href", ""))
        elif tag == "a" and "href" in values:
            self.links.append(values["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> dict[Path, Page]:
    """Every page of the built site."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        pytest.skip(f'{", ".join(missing)} not installed: pip install ".[docs]"')
    place = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-c", "docs", ".", str(place)]
    done = subprocess.run(
        command, check=False, capture_output=True, text=True, timeout=300, cwd=ROOT,
        env={**os.environ, "http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return {file: Page(file.read_text(encoding="utf-8")) for file in place.rglob("*.html")}


def test_every_link_of_the_site_leads_somewhere(site):
    followed, wrong = 0, []
    for file, page in site.items():
        for link in [*page.links, *page.loaded]:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            followed += 1
            target = Path(os.path.normpath(file.parent / unquote(parts.path))) if parts.path else file
            exists = target.exists()
            if exists and parts.fragment and target in site:
                exists = unquote(parts.fragment) in site[target].ids
            if not exists:
                wrong.append(f"{file.name}: {link}")
    assert followed > 2000
    assert not wrong, sorted(set(wrong))[:20]


def test_a_reader_fetches_nothing(site):
    root = Path(os.path.commonpath([file.parent for file in site]))
    assert (root / "index.html") in site
    loaded = {link for page in site.values() for link in page.loaded}
    assert len(loaded) > 10
    assert not [link for link in loaded if urlsplit(link).netloc or urlsplit(link).scheme not in ("", "data")]
    styles = [file.read_text(encoding="utf-8") for file in root.rglob("*.css")]
    assert styles
    assert not [style for style in styles if "url(http" in style or 'url("http' in style or "@import" in style]


def test_public_names_stand_in_the_site_once(site):
    names = [f"collide.{name}" for name in collide.__all__]
    names += [f"collide.scenes.{name}" for name in collide.scenes.__all__]
    places = {name: [file.name for file, page in site.items() if name in page.ids] for name in names}
    assert len(names) > 60
    wrong = {name: files for name, files in places.items() if len(files) != 1}
    assert not wrong, wrong
