"""Hosts: programs written for another engine run on collide unchanged, through modules with that engine's names.

`HOSTS` is what `collide doctor` lists, one line a host. Nothing is imported before it is asked for.
"""

from __future__ import annotations

from typing import NamedTuple


class Host(NamedTuple):
    """One engine whose programs run on collide.

    name : as its users call it.   package : its distribution, which need not be installed.   module : ours.
    replaces : what its programs import.
    """

    name: str
    package: str
    module: str
    replaces: str


HOSTS = (Host("python-fcl", "python-fcl", "collide.adapters.hosts.fcl_api", "fcl"),)
