"""The line about long work: on a terminal, elsewhere, nested, and where the stream is closed."""

from __future__ import annotations

import io
import time
from contextlib import contextmanager

import pytest

from collide import scenes
from collide.reports.progress import Progress, silent


@pytest.fixture(autouse=True)
def shown_by_hand(monkeypatch):
    """The thread that watches stages shows none of them while a test runs."""
    monkeypatch.setattr("collide.reports.progress._TICK", 1e6)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def older(progress: Progress, seconds: float) -> None:
    """The innermost stage has lasted so much longer."""
    progress._stages[-1].started -= seconds


@pytest.mark.parametrize(("seconds", "written"), [(0.0, False), (1.5, False), (2.5, True)])
def test_elsewhere_a_stage_that_lasts_is_named_once_and_when_it_is_done(seconds, written):
    stream = io.StringIO()
    progress = Progress(stream)
    with progress("reading"):
        older(progress, seconds)
        for _ in range(2):
            progress._show(progress._stages[-1])
    lines = stream.getvalue().splitlines()
    assert (lines[:1] == ["collide: reading ..."]) == written and len(lines) == 2 * written
    assert not written or lines[1].startswith("collide: reading: done in 2.5")


@pytest.mark.parametrize(("seconds", "written"), [(0.0, False), (0.3, False), (0.7, True), (12.0, True)])
def test_a_terminal_shows_the_seconds_and_is_cleared(seconds, written):
    stream = Terminal()
    progress = Progress(stream)
    with progress("reading") as rename:
        rename("reading part 2")
        older(progress, seconds)
        progress._show(progress._stages[-1])
    text = stream.getvalue()
    assert text == (f"\r\x1b[2Kreading part 2 … {seconds:.0f} s\r\x1b[2K" if written else "")


def test_stages_nest_and_one_thread_watches_all_of_them():
    progress = Progress(io.StringIO())
    with progress("outer"):
        thread = progress._thread
        with progress("inner"):
            assert [stage.label for stage in progress._stages] == ["outer", "inner"] and progress._thread is thread
        assert thread.is_alive() and not progress._wake.is_set()
    assert not thread.is_alive() and progress._stages == []
    with progress("again"):
        assert progress._thread is not thread and progress._thread.is_alive()


def test_a_stage_that_fails_ends_as_others():
    progress = Progress(io.StringIO())
    with pytest.raises(ValueError, match="broken"), progress("work"):
        raise ValueError("broken")
    assert progress._stages == [] and not progress._thread.is_alive()


def test_seconds_of_a_stage_are_those_that_passed():
    progress, begun = Progress(io.StringIO()), time.monotonic()
    with progress("work"):
        assert 0.0 <= progress._stages[0].seconds <= time.monotonic() - begun
    with silent("work") as rename:
        assert rename is None


def test_streams_that_are_closed_or_know_few_letters():
    class Ascii(Terminal):
        def write(self, text):
            text.encode("ascii")
            return super().write(text)

    stream = Ascii()
    progress = Progress(stream)
    progress._write("reading … 1 s")
    assert stream.getvalue() == "reading ... 1 s"
    closed = Terminal()
    progress = Progress(closed)
    closed.close()
    progress._write("text")
    assert not progress.terminal


def labels_of(work) -> list[str]:
    """Labels that ``work(progress)`` gives."""
    labels: list[str] = []

    @contextmanager
    def progress(label: str):
        labels.append(label)
        yield labels.append

    work(progress)
    return labels


def test_reading_several_files_says_how_far_it_is(tmp_path):
    files = [tmp_path / f"{name}.off" for name in "abcd"]
    for file in files:
        file.write_text("OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
    labels = labels_of(lambda progress: scenes.load(*files, progress=progress))
    assert labels[0] == "reading the scene"
    shares = [label.split(", ")[0] for label in labels[1:]]
    assert shares == [f"reading the scene: {k}%" for k in (0, 25, 50, 75)]
    assert labels[-1].endswith("d.off")
