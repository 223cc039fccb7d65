"""Children are asked, waited for, and end: whatever they do, whatever they print, whoever is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import closing

import pytest

from collide.base.child_process import ChildProcess, last_words

SERVANTS = '''
import ctypes, os, sys, time

def echo(requests, send, *arguments):
    for message in requests:
        send((arguments, message))

def noise(requests, send):
    os.write(1, b"noise " * 20_000)
    print("more noise")
    send(sys.stdin.read())

def end(requests, send, how):
    print("/usr/lib/last words", file=sys.stderr, flush=True)
    os.abort() if how == "abort" else os._exit(how)

def half(requests, send):
    os.write(send.__self__.fileno(), b"\\0\\0\\1\\0half of 256 bytes")
    os._exit(0)

def sleep(requests, send):
    send(os.getpid())
    time.sleep(600)

def hold_the_lock(requests, send):
    send(os.getpid())
    ctypes.PyDLL(None).sleep(600)  # as a library does that hangs without giving back the interpreter's lock
'''

PARENT = '''
import sys, time
sys.path.insert(0, sys.argv[1])
from collide.base.child_process import ChildProcess
child = ChildProcess("servants:" + sys.argv[2])
print(child.receive(60), flush=True)
time.sleep(600)
'''


@pytest.fixture
def servants(tmp_path, monkeypatch):
    (tmp_path / "servants.py").write_text(SERVANTS)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def test_messages_go_both_ways_in_their_order(servants):
    with closing(ChildProcess("servants:echo", 7, "a")) as child:
        large = b"x" * 2_000_000  # more than a pipe holds, both ways
        for message in (1, large, None):
            child.send(message)
        assert [child.receive(60) for _ in range(3)] == [((7, "a"), 1), ((7, "a"), large), ((7, "a"), None)]


def test_what_is_printed_does_not_mix_and_nothing_is_read_from_the_terminal(servants):
    with closing(ChildProcess("servants:noise")) as child:
        assert child.receive(60) == ""
        with pytest.raises(EOFError):
            child.receive(60)
        assert child.how_it_ended().startswith("process ended with code 0: ") and "more noise" in child.how_it_ended()


@pytest.mark.parametrize(
    "how, told",
    [(7, "process ended with code 7"), ("abort", "process aborted (SIGABRT)"), (0, "process ended with code 0")],
)
def test_an_end_is_told_with_its_reason(servants, how, told):
    with closing(ChildProcess("servants:end", how)) as child:
        with pytest.raises(EOFError):
            child.receive(60)
        assert child.how_it_ended() == f"{told}: last words"


def test_what_a_child_cannot_import_is_told(servants):
    with closing(ChildProcess("no_such_module:f")) as child:
        with pytest.raises(EOFError):
            child.receive(60)
        assert "no_such_module" in child.how_it_ended()


def test_half_a_message_is_an_end(servants):
    with closing(ChildProcess("servants:half")) as child, pytest.raises(EOFError):
        child.receive(60)


def test_a_child_that_reads_nothing_holds_nobody_up(servants):
    started = time.monotonic()
    with closing(ChildProcess("servants:sleep")) as child:
        pid = child.receive(60)
        assert pid == child.pid
        child.send(bytes(20_000_000))
        with pytest.raises(TimeoutError):
            child.receive(0.2)
    assert not _runs(pid) and time.monotonic() - started < 30


def test_an_interruption_is_the_parents_business(servants):
    with closing(ChildProcess("servants:echo")) as child:
        child.send(1)
        assert child.receive(60) == ((), 1)
        os.kill(child.pid, signal.SIGINT)
        child.send(2)
        assert child.receive(60) == ((), 2)


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
@pytest.mark.parametrize(
    "servant",
    ["sleep", pytest.param("hold_the_lock", marks=pytest.mark.skipif(sys.platform != "linux", reason="SIGIO ends it"))],
)
def test_no_child_outlives_a_parent_that_is_killed(servants, servant):
    command = [sys.executable, "-c", PARENT, str(servants), servant]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        pid = int(parent.stdout.readline())
        assert _runs(pid)
        parent.kill()
    ends = time.monotonic() + 20
    while _runs(pid) and time.monotonic() < ends:
        time.sleep(0.02)
    if _runs(pid):
        os.kill(pid, signal.SIGKILL)
        pytest.fail(f"{servant} outlived its parent by 20 s")


def _runs(pid: int) -> bool:
    """Whether a process is there and no zombie, which waits for whoever adopted it."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], check=False, capture_output=True, text=True).stdout
    return not state.strip().startswith("Z") and bool(state.strip())


def test_last_words_are_one_line_without_folders():
    assert last_words("terminate called\n  what():  bad\n input at /a/b-1/c.h:12\n") == "bad input at c.h:12"
    assert last_words("noise\n" * 100 + "the end").endswith("noise the end")
    assert last_words("") == ""
