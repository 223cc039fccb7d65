"""The file of a page: names stay text, the policy fits, and a page is written whole or not at all."""

from __future__ import annotations

import base64
import hashlib
import os
import random
import re

import pytest
from parsed_page import Page, small_viewer

from collide.errors import InvalidArgument
from collide.pages.page_file import VIEWER, DataBlock, ReportBlock, page_pieces, write_page

HOSTILE = [
    "<script>alert(1)</script>", "</script><script>alert(1)</script>", "</ScRiPt >", "<!--", "-->", "<!--<script>",
    "]]>", '"', "'", "\\", "\\u003c", "&lt;b&gt;", "&amp;", "a\nb", "a\r\nb", "\t\x00\x1b[31m", "\u202eevil\u202c",
    "\u2028\u2029", "\u05e9\u05dc\u05d5\u05dd", "\ud800", "\U0001f916", "x" * 10_000, "<" * 10_000, '"}]}</script>',
    "{{constructor}}", "__proto__", "javascript:alert(1)", "<img src=x onerror=alert(1)>", "%s%n", "<!--DATA-->",
    "<!--SCRIPT-->", "",
]


@pytest.fixture
def viewer(tmp_path):
    return small_viewer(tmp_path / "viewer")


def made(viewer, names, title="title", **options) -> str:
    blocks = [
        ReportBlock("report", {"names": names, "by_name": {name: 1 for name in names}}.items()),
        DataBlock("drawing", {"bodies": [{"name": name} for name in names], "notes": names, "size": 1.5}),
        DataBlock("contacts", [{"a": name} for name in names]),
    ]
    return "".join(page_pieces(title, blocks, viewer=viewer, **options))


def test_names_stay_text(viewer):
    plain = Page(made(viewer, ["a"] * len(HOSTILE)))
    page = Page(made(viewer, HOSTILE))
    assert page.elements == plain.elements and page.comments == plain.comments == []
    assert page.attributes[3:] == plain.attributes[3:]
    assert page.data("report")["names"] == HOSTILE
    assert list(page.data("report")["by_name"]) == list(dict.fromkeys(HOSTILE))
    assert [body["name"] for body in page.data("drawing")["bodies"]] == HOSTILE
    assert page.data("drawing")["notes"] == HOSTILE and page.data("drawing")["size"] == 1.5
    assert [entry["a"] for entry in page.data("contacts")] == HOSTILE


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_titles_stay_text(viewer, name):
    page = Page(made(viewer, [], title=name))
    assert page.elements == Page(made(viewer, [])).elements
    if len(name) < 100 and name.isprintable() and name:
        assert page.texts["title", ""] == name
    assert len(page.texts.get(("title", ""), "")) <= 400


def test_names_by_chance(viewer):
    seed = 23
    draw = random.Random(seed)
    letters = "<>/!-&;'\"\\scriptSCRIPT \n\u2028\u202e\x00\ud83d"
    names = ["".join(draw.choices(letters, k=draw.randint(1, 30))) for _ in range(3000)]
    hits = sum("</s" in name.lower() or "<!-" in name or "<s" in name.lower() for name in names)
    assert hits > 50, "the letters no longer make tags"
    page = Page(made(viewer, names))
    assert page.elements == Page(made(viewer, ["a"])).elements
    for name, read in zip(names, page.data("report")["names"], strict=True):
        assert read == name, f"Page(made(viewer, [{name!r}]))"


def test_the_viewer_that_ships():
    """As much of a page as a parser sees: hostile names add no element, and the script is one."""
    page, plain = Page(made(VIEWER, HOSTILE)), Page(made(VIEWER, ["a"]))
    assert page.elements == plain.elements and page.elements["script"] == 4
    assert page.data("report")["names"] == HOSTILE and not page.comments
    for tag, attributes in page.attributes:
        # hashes of the policy are base64, which has slashes
        bad = re.compile(r"^\s*//|://")
        assert not any(name.startswith("on") or bad.search(value or "") for name, value in attributes.items()), tag


def test_data_are_ascii_without_markup(viewer):
    text = made(viewer, HOSTILE)
    for name in ("report", "drawing", "contacts"):
        inner = Page(text).texts["script", name]
        assert inner.isascii() and not set("<>&") & set(inner), name


@pytest.mark.parametrize("live", [False, True])
@pytest.mark.parametrize("ships", [False, True])
def test_policy_names_what_stands_in_the_page(viewer, live, ships):
    page = Page(made(VIEWER if ships else viewer, ["a"], live=live))
    hashes = {
        tag: f"'sha256-{base64.b64encode(hashlib.sha256(page.texts[tag, ''].encode()).digest()).decode()}'"
        for tag in ("script", "style")
    }
    rules = dict(rule.split(" ", 1) for rule in page.policy.split("; "))
    assert rules["default-src"] == "'none'" and rules["script-src"] == hashes["script"]
    assert rules["style-src"] == hashes["style"] and "unsafe" not in page.policy
    assert rules.get("connect-src") == ("'self'" if live else None)
    position = {tag: k for k, (tag, _) in reversed(list(enumerate(page.attributes)))}
    policy = next(k for k, (_, a) in enumerate(page.attributes) if a.get("http-equiv"))
    assert policy < position["style"] < position["script"], "what stands before the policy is not under it"


def test_nothing_is_fetched(viewer):
    page = Page(made(viewer, HOSTILE))
    for tag, attributes in page.attributes:
        assert not {"src", "href", "srcset", "action", "data"} & set(attributes), (tag, attributes)
        assert not any(name.startswith("on") for name in attributes)


@pytest.mark.parametrize(
    ("file", "text", "complaint"),
    [
        ("bundle.js", "a('</ScRipt>')", "</script"), ("bundle.js", "// <!-- ", "<!--"),
        ("page.css", "</style>", "</style"),
        ("page.html", "<html></html>", "<!--DATA-->"), ("page.html", None, "install"), ("bundle.js", None, "install"),
    ],
)
def test_broken_viewers_are_refused(viewer, file, text, complaint):
    if text is None:
        (viewer / file).unlink()
    else:
        (viewer / file).write_text(text, encoding="utf-8")
    with pytest.raises(InvalidArgument, match=complaint) as error:
        made(viewer, ["a"])
    assert file in str(error.value)


def test_numbers_that_json_does_not_know_are_refused(viewer):
    for value in (float("nan"), float("inf")):
        with pytest.raises(ValueError, match="JSON"):
            "".join(page_pieces("t", [DataBlock("drawing", {"size": value})], viewer=viewer))


# --- to a file ----------------------------------------------------------------------------------


def test_page_is_written_as_it_is(tmp_path):
    place = tmp_path / "page.html"
    write_page(["a\n", "é\r\n"], str(place))
    assert place.read_bytes() == "a\né\r\n".encode()
    assert os.listdir(tmp_path) == ["page.html"]


def test_what_breaks_off_leaves_the_old_page(tmp_path):
    def pieces():
        yield "half"
        raise KeyboardInterrupt

    place = tmp_path / "page.html"
    place.write_text("old", encoding="utf-8")
    place.chmod(0o640)
    with pytest.raises(KeyboardInterrupt):
        write_page(pieces(), str(place))
    assert place.read_text(encoding="utf-8") == "old" and os.listdir(tmp_path) == ["page.html"]
    write_page(["new"], str(place))
    assert place.read_text(encoding="utf-8") == "new" and place.stat().st_mode & 0o777 == 0o640


def test_links_keep_leading_to_their_file(tmp_path):
    real, link = tmp_path / "real.html", tmp_path / "link.html"
    real.write_text("old", encoding="utf-8")
    link.symlink_to(real)
    write_page(["new"], str(link))
    assert link.is_symlink() and real.read_text(encoding="utf-8") == "new"


def test_places_that_cannot_be_written_are_named(tmp_path):
    for place in (tmp_path / "none" / "page.html", tmp_path / ("x" * 251 + ".html")):
        with pytest.raises(OSError) as error:
            write_page(["a"], str(place))
        assert error.value.filename == str(place)
    write_page(["a"], str(tmp_path / ("x" * 250 + ".html")))  # the longest name that file systems have


def test_devices_are_written_to_as_they_are():
    write_page(["a"], os.devnull)
    assert not os.path.isfile(os.devnull)


def test_standard_output_gets_utf8(capfdbinary):
    write_page(["a ", "é"], "-")
    assert capfdbinary.readouterr().out == "a é".encode()
