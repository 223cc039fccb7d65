"""Whether the hooks of hosts hold: each asked in a child process with a time limit, as `collide doctor` shows it.

A crash, an abort or a hang of a host costs its line and no more. The child is
``python -m collide.adapters.hosts.host_checks MODULE``.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from importlib import import_module, metadata
from typing import NamedTuple

from collide.adapters.hosts import Host
from collide.errors import MissingExtra, UnsupportedQuery

#: How long all children together may take [s].
LIMIT = 60.0
#: The child's finding is the line of its output that begins so: what hosts print goes before it.
_MARK = "HOST CHECK "
#: How many characters of a dead child's last line of stderr are told.
_LAST_WORDS = 160


class HostFinding(NamedTuple):
    """version : of the host's distribution, None where it is not installed.   answer : one line.
    passed : None where a host is not installed or refuses, False where something is broken.
    """

    version: str | None
    passed: bool | None
    answer: str


def check_hosts(hosts: Sequence[Host], limit: float = LIMIT) -> list[HostFinding]:
    """Ask every host's ``check``, all at once.

    Parameters
    ----------
    hosts : of `collide.adapters.hosts.HOSTS`.
    limit : when to give up, for all together [s].

    Returns
    -------
    [HostFinding, …], one a host.
    """
    versions = [_version(host.package) for host in hosts]
    asked = [None if host.is_needed and version is None else _child(host) for host, version in zip(hosts, versions)]
    deadline = time.monotonic() + limit
    return [
        HostFinding(version, *((None, "not asked") if child is None else _finding(child, deadline)))
        for version, child in zip(versions, asked)
    ]


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _child(host: Host) -> subprocess.Popen:
    command = [sys.executable, "-m", __spec__.name, host.module]
    return subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, errors="replace"
    )


def _finding(child: subprocess.Popen, deadline: float) -> tuple[bool | None, str]:
    try:  # a second is for reading what a child said that has ended in time
        out, err = child.communicate(timeout=max(1.0, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        return False, "no answer within the time limit: it hangs"
    replies = [line for line in out.splitlines() if line.startswith(_MARK)]
    if replies:
        passed, answer = json.loads(replies[-1][len(_MARK) :])
        return passed, answer
    words = (err.strip().splitlines() or ["nothing said"])[-1][-_LAST_WORDS:]
    code = child.returncode
    how = f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with status {code}"
    return False, f"its process {how}: {words}"


def answer_of(module: str) -> tuple[bool | None, str]:
    """What a host's module says of itself, in this process: (passed, one line).

    module : whose ``check()`` returns a line where hooks hold, and raises where they do not. MissingExtra and
        UnsupportedQuery are refusals, which are worth knowing; all else is broken.
    """
    try:
        loaded = import_module(module)
        check = getattr(loaded, "check", None)
        return True, "can be imported" if check is None else str(check())
    except (MissingExtra, UnsupportedQuery) as error:
        return None, str(error)
    except Exception as error:  # noqa: BLE001 - told, whatever broke
        return False, f"{type(error).__name__}: {error}"


if __name__ == "__main__":
    print(_MARK + json.dumps(answer_of(sys.argv[1])), flush=True)
