"""`collide view`: a page of files that is made anew when one of them changes, and the command that serves it."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import signal
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path

import pytest

from collide.adapters.live.page_state import live_block
from collide.adapters.live.scene_viewer import SceneViewer
from collide.cli.arguments import parse
from collide.cli.main import main
from collide.cli.view import _files, _page
from collide.errors import SceneError

ROOT = Path(__file__).resolve().parents[3]
SCENE = """collide: 1
bodies:
  - {name: table, shape: {box: {size: [1, 1, 0.1]}}, static: true}
  - {name: ball, shape: {sphere: {radius: 0.1}}, pose: {xyz: [0, 0, HEIGHT]}}
"""


def events(url: str, drawing: int):
    """(name, data) of each event that a page of this number hears."""
    with urllib.request.urlopen(f"{url}events?drawing={drawing}", timeout=20) as stream:
        name = ""
        for line in stream:
            field, _, value = line.decode().rstrip("\n").partition(": ")
            if field == "event":
                name = value
            elif field == "data":
                yield name, value


#: The command `collide`; where tests run in the background, what they start would ignore Ctrl-C.
MINDS_CTRL_C = """
import signal, sys
from collide.cli.main import main
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.exit(main())
"""


class Maker:
    """Makes a page of a file's text; refuses text that is marked as wrong."""

    def __init__(self, file: Path):
        self.file, self.made = file, []

    def __call__(self, number: int):
        text = self.file.read_text(encoding="utf-8")
        if "wrong" in text:
            raise SceneError(f"{self.file.name}: {text}")
        self.made.append(number)
        return f"<p>{text} {live_block(number).data['events']}</p>", [str(self.file)]


SECONDS = itertools.count(10**9)


def write(file: Path, text: str) -> None:
    """Write a file beside it and put it in its place, as editors do, at a time that no other write has."""
    beside = file.with_suffix(".new")
    beside.write_text(text, encoding="utf-8")
    os.utime(beside, (now := next(SECONDS), now))
    beside.replace(file)


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "scene.yaml"
    write(file, "first")
    return file


def page_of(viewer) -> str:
    return urllib.request.urlopen(viewer.url, timeout=20).read().decode()


def test_a_changed_file_makes_the_page_anew(file):
    make = Maker(file)
    viewer = SceneViewer(make)
    try:
        assert "first events?drawing=0" in page_of(viewer)
        assert not viewer.look() and make.made == [0]
        heard = events(viewer.url, 0)
        write(file, "second")
        assert viewer.look() and make.made == [0, 1]
        assert next(heard) == ("reload", "{}")
        assert "second events?drawing=1" in page_of(viewer)
        assert not viewer.look()
    finally:
        viewer.close()


def test_a_file_that_cannot_be_read_leaves_the_page_and_says_so(file):
    viewer = SceneViewer(Maker(file))
    try:
        heard = events(viewer.url, 0)
        write(file, "wrong: line 3")
        assert viewer.look() and viewer.problem == "scene.yaml: wrong: line 3"
        assert next(heard) == ("problem", '{"text": "scene.yaml: wrong: line 3"}')
        assert "first" in page_of(viewer)
        file.unlink()
        assert viewer.look() and "No such file" in viewer.problem
        name, data = next(heard)
        assert name == "problem" and "No such file" in data
        write(file, "third")
        assert viewer.look() and viewer.problem is None
        assert next(heard) == ("reload", "{}")
        assert "third" in page_of(viewer)
    finally:
        viewer.close()


def test_following_looks_until_it_is_told_to_stop(file):
    viewer = SceneViewer(Maker(file))
    stop, looked = threading.Event(), threading.Event()
    thread = threading.Thread(target=viewer.follow, args=(stop, 0.01, looked.set))
    thread.start()
    try:
        write(file, "later")
        assert looked.wait(10)
        assert "later" in page_of(viewer)
    finally:
        stop.set()
        thread.join(10)
        viewer.close()
    assert not thread.is_alive()


def test_the_first_page_is_refused_like_a_report(file):
    write(file, "wrong")
    before = threading.active_count()
    with pytest.raises(SceneError):
        SceneViewer(Maker(file))
    assert threading.active_count() == before


def test_the_command_watches_what_it_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = tmp_path / "cell.yaml"
    scene.write_text(SCENE.replace("HEIGHT", "0.5"), encoding="utf-8")
    args = parse(["view", "cell.yaml", "--clearance", "1cm", "--no-browser"])
    text, files = _page(args, contextlib.nullcontext, None, 7)
    assert files == [str(scene)]
    assert "events?drawing=7" in text and '"cell' in text
    assert _files(parse(["view", "workcell", "--state", "cell.yaml"]), []) == [str(scene)]


def test_a_scene_in_a_browser_from_start_to_end(tmp_path):
    """The command itself: prints its address, reads an edited file again, ends with 0 on Ctrl-C."""
    scene = tmp_path / "cell.yaml"
    write(scene, SCENE.replace("HEIGHT", "0.5"))
    command = [sys.executable, "-c", MINDS_CTRL_C, "view", str(scene), "--no-browser"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT, start_new_session=True
    ) as process:
        try:
            url = process.stdout.readline().strip()
            assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32,}/", url), process.stderr.read()
            page = urllib.request.urlopen(url, timeout=20).read().decode()
            assert re.search(r'"verdict": \{\s*"text": "no collision', page)
            heard = events(url, 0)
            write(scene, SCENE.replace("HEIGHT", "0.1"))
            assert next(heard) == ("reload", "{}")
            page = urllib.request.urlopen(url, timeout=20).read().decode()
            assert re.search(r'"verdict": \{\s*"text": "1 collision', page)
            heard = events(url, 1)
            write(scene, SCENE.replace("HEIGHT", "nowhere"))
            name, data = next(heard)
            assert name == "problem" and "nowhere" in data and "cell.yaml" in data
            process.send_signal(signal.SIGINT)
            assert next(heard) == ("closed", "{}")
            assert process.wait(20) == 0
            said = process.stderr.read()
            assert "watching" in said and "read again" in said and "Traceback" not in said
        finally:
            process.kill()


@pytest.mark.parametrize("port", ["-1", "65536", "eighty"])
def test_ports_that_are_none_are_refused(port, capsys):
    assert main(["view", "workcell", "--no-browser", f"--port={port}"]) == 2
    assert "must be 0 … 65535" in capsys.readouterr().err


def test_a_scene_that_is_not_there_is_an_error(capsys):
    assert main(["view", "no_such_scene.yaml", "--no-browser"]) == 2
    assert "no_such_scene" in capsys.readouterr().err
