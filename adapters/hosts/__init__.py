"""Programs written for other engines, run on collide: one module a host.

Nothing of a host is imported before it is asked for. `HOSTS` is what `collide doctor` lists, one line a host. A new
host is a line there, and a function ``check() -> str`` in its module: it does what users do (install, ask one pair
whose answer is known, uninstall), returns one line that says what held, and raises where something did not:
`MissingExtra` and `UnsupportedQuery` where the host is refused politely, anything else where it is broken. The doctor
calls it in a child process with a time limit (`host_checks.py`), so that it may import the host, and the host may
abort. Nothing is written to a host's files, and no server or window is opened.
"""

from __future__ import annotations

from importlib import import_module
from typing import NamedTuple


class Host(NamedTuple):
    """One engine whose programs run on collide.

    name : as its users call it.   package : its distribution.   is_needed : whether that must be installed.
    module : ours, whose ``check()`` says whether hooks hold.   usage : how a program comes to use it.
    """

    name: str
    package: str
    is_needed: bool
    module: str
    usage: str


HOSTS = (
    Host("MuJoCo", "mujoco", True, "collide.adapters.hosts.mujoco", "with install(model): steps have our contacts"),
    Host("python-fcl", "python-fcl", False, "collide.adapters.hosts.fcl_api", "after install(), import fcl finds it"),
    Host("coal", "coal", False, "collide.adapters.hosts.coal_api", "after install(), import coal and hppfcl find it"),
    Host("Pinocchio", "pin", True, "collide.adapters.hosts.pinocchio", "compute_collisions for pin.computeCollisions"),
    Host("pybullet", "pybullet", True, "collide.adapters.hosts.pybullet_mirror", "attach(pybullet): answers are ours"),
    Host("Newton", "newton", True, "collide.adapters.hosts.newton", "Pipeline(model): contacts for solver.step"),
)


def __getattr__(name: str):
    """The module of a host, imported when it is named: ``collide.adapters.hosts.mujoco``."""
    module = f"{__name__}.{name}"
    if module not in {host.module for host in HOSTS}:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(module)
