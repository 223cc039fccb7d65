"""Programs written for other engines, run on collide: one module a host.

Nothing of a host is imported before it is asked for. `HOSTS` is what `collide doctor` lists, one line a host.
"""

from __future__ import annotations

from typing import NamedTuple


class Host(NamedTuple):
    """One engine whose programs run on collide.

    name : as its users call it.   package : its distribution.   is_needed : whether that must be installed.
    module : ours.   usage : how a program comes to use it.
    """

    name: str
    package: str
    is_needed: bool
    module: str
    usage: str


HOSTS = (
    Host("MuJoCo", "mujoco", True, "collide.adapters.hosts.mujoco", "with install(model): steps have our contacts"),
    Host("python-fcl", "python-fcl", False, "collide.adapters.hosts.fcl_api", "after install(), import fcl finds it"),
)
