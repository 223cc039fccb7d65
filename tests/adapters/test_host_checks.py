"""Hosts are asked in children: what crashes, hangs, refuses or is absent costs its line and no more."""

from __future__ import annotations

import importlib.util
import os
import time

import pytest

from collide.adapters.hosts import HOSTS, Host
from collide.adapters.hosts.host_checks import check_hosts

CHECKS = {
    "sound": "print('a host that talks')\ndef check():\n    print('HOST CHECK that talks')\n    return 'held'",
    "silent": "",
    "broken": "def check():\n    raise RuntimeError('the hook is loose')",
    "unimportable": "import no_such_module",
    "refusing": "from collide.errors import UnsupportedQuery\ndef check():\n    raise UnsupportedQuery('version 99')",
    "lacking": "from collide.errors import MissingExtra as M\ndef check():\n    raise M('h', extra='h', purpose='h')",
    "aborting": "import os, sys\ndef check():\n    print('last words', file=sys.stderr, flush=True)\n    os.abort()",
    "leaving": "import sys\ndef check():\n    sys.exit(3)",
    "hanging": "import time\ndef check():\n    time.sleep(600)",
}


@pytest.fixture
def modules(tmp_path, monkeypatch):
    for name, source in CHECKS.items():
        (tmp_path / f"trial_{name}.py").write_text(source + "\n")
    monkeypatch.syspath_prepend(tmp_path)


def host(name: str, package: str = "numpy") -> Host:
    return Host(name, package, True, f"trial_{name}", "")


def test_every_end_is_told(modules):
    names = [name for name in CHECKS if name != "hanging"]
    found = dict(zip(names, check_hosts([host(name) for name in names])))
    assert found["sound"][1:] == (True, "held")
    assert found["silent"][1:] == (True, "can be imported")
    assert found["broken"][1:] == (False, "RuntimeError: the hook is loose")
    assert found["unimportable"].passed is False and "no_such_module" in found["unimportable"].answer
    assert found["refusing"][1:] == (None, "version 99")
    assert found["lacking"].passed is None and "collide-robotics[h]" in found["lacking"].answer
    assert found["leaving"].passed is False and "code 3" in found["leaving"].answer
    assert found["aborting"].passed is False
    if os.name == "posix":
        assert found["aborting"].answer == "its process aborted (SIGABRT): last words"


def test_what_hangs_is_given_up(modules):
    begin = time.monotonic()
    hanging, sound = check_hosts([host("hanging"), host("sound")], limit=3.0)
    assert time.monotonic() - begin < 30.0
    assert hanging.passed is False and "time limit" in hanging.answer
    assert sound.passed is True  # which had ended by then


def test_what_is_not_installed_is_not_asked(modules):
    found = check_hosts([host("broken", "no-such-distribution")])[0]
    assert found == (None, None, "not asked")
    not_needed = Host("sound", "no-such-distribution", False, "trial_sound", "")
    assert check_hosts([not_needed])[0] == (None, True, "held")


@pytest.mark.slow
def test_hooks_hold():
    """Of every host that is installed here; one that is not needs a reason that names its extra."""
    for one, found in zip(HOSTS, check_hosts(HOSTS)):
        assert importlib.util.find_spec(one.module) is not None
        assert found.passed is not False, (one.name, found.answer)
        assert found.answer != "can be imported", f"{one.module} has no check()"
