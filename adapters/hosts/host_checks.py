"""Whether the hooks of hosts hold: each asked in a child process with a time limit, as `collide doctor` shows it.

A crash, an abort or a hang of a host costs its line and no more.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from importlib import import_module, metadata
from typing import NamedTuple

from collide.adapters.hosts import Host
from collide.base.child_process import ChildProcess
from collide.errors import MissingExtra, UnsupportedQuery

#: How long all children together may take [s].
LIMIT = 60.0


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


def _child(host: Host) -> ChildProcess:
    return ChildProcess(f"{__name__}:report_answer", host.module)


def _finding(child: ChildProcess, deadline: float) -> tuple[bool | None, str]:
    with closing(child):
        try:  # a second is for reading what a child said that has ended in time
            return child.receive(max(1.0, deadline - time.monotonic()))
        except TimeoutError:
            return False, "no answer within the time limit: it hangs"
        except EOFError:
            return False, f"its {child.how_it_ended()}"


def report_answer(requests: Iterator, send: Callable[[tuple[bool | None, str]], None], module: str) -> None:
    """The child: send `answer_of`."""
    send(answer_of(module))


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
