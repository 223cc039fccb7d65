"""Modules of ours in the place of a host's: what ``import`` finds between `install` and `uninstall`."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import PathFinder
from types import ModuleType
from typing import Any


def warn_of_holders(host: ModuleType, name: str, *, stacklevel: int) -> list[str]:
    """Names of modules, collide's and the host's own excepted, that hold a host already; a RuntimeWarning says them."""
    holders = sorted(
        holder
        for holder, module in list(sys.modules.items())
        if isinstance(module, ModuleType) and holder.partition(".")[0] not in ("collide", name)
        and any(value is host for value in list(vars(module).values()))
    )
    if holders:
        warnings.warn(
            f"these modules hold {name} already: {', '.join(holders)}; install() before they are imported",
            RuntimeWarning,
            stacklevel=stacklevel + 1,
        )
    return holders


class StandIn:
    """Lets imports of a host find modules of ours.

    modules : by the name that programs import. The first is the host's, the value of a ``with`` block; names of
        packages take the place of everything within them.
    built_on : packages that are bindings of the host's own objects: while one is imported, imports find the host.

    Notes
    -----
    Only ``sys.modules`` changes, and ``sys.meta_path`` where packages are built on the host; both are put back. Modules
    that imported the host before keep it.
    """

    def __init__(self, modules: Mapping[str, ModuleType], built_on: tuple[str, ...] = ()):
        self._modules = dict(modules)
        self._finder = _FinderAside(self, built_on)
        #: What ``sys.modules`` held under the host's names; None while not installed.
        self._before: dict[str, ModuleType] | None = None

    @property
    def installed(self) -> bool:
        """Whether imports find our modules."""
        return self._before is not None

    def install(self) -> StandIn:
        """Until `uninstall`, or to the end of a ``with`` block. Installing twice is as once.

        A RuntimeWarning names modules that hold the host already, or nothing in its place.
        """
        if self._before is None:
            before = self._take()
            holders = self._holders(before)
            if holders:
                host = next(iter(self._modules))
                warnings.warn(
                    f"these modules hold another {host} already: {', '.join(holders)}; install() before they are "
                    "imported",
                    RuntimeWarning,
                    stacklevel=3,
                )
        return self

    def _take(self) -> dict[str, ModuleType]:
        """Ours in; what was there."""
        self._before = {name: sys.modules[name] for name in self._names()}
        for name in self._before:
            del sys.modules[name]
        sys.modules.update(self._modules)
        sys.meta_path.insert(0, self._finder)
        return self._before

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Imports find the host itself within the block, where ours is installed."""
        is_installed = self.installed
        self.uninstall()
        try:
            yield
        finally:
            if is_installed:
                self._take()

    def uninstall(self) -> None:
        """Put back what imports found before; modules that hold ours keep them."""
        if self._before is None:
            return
        for name in self._names():
            del sys.modules[name]
        sys.modules.update(self._before)
        sys.meta_path.remove(self._finder)
        self._before = None

    def check(self, gap_of: Callable[[Any], float]) -> str:
        """Install, ask one pair of what imports find, uninstall: one line for `collide doctor`.

        gap_of : asks a module for the gap of a ball and a box 1 m apart [m].   Raises RuntimeError for what does not
        hold.
        """
        hosts = list(dict.fromkeys(name.split(".")[0] for name in self._modules))
        before = [sys.modules.get(name) for name in hosts]
        with self.install() as module:
            imported = [import_module(name) for name in hosts]
            gap = gap_of(imported[0])
        if any(host is not module for host in imported) or gap != 1.0:
            names = ", ".join(host.__name__ for host in imported)
            raise RuntimeError(f"import {hosts[0]} finds {names}; a ball and a box 1 m apart: {gap!r} m")
        if [sys.modules.get(name) for name in hosts] != before:
            raise RuntimeError(f"uninstall() did not put back what import {hosts[0]} found before")
        imports = " and ".join(f"import {name}" for name in hosts)
        return f"{imports} {'finds' if len(hosts) == 1 else 'find'} it, a pair was answered, uninstalled cleanly"

    def __enter__(self) -> ModuleType:
        return next(iter(self._modules.values()))

    def __exit__(self, *exception) -> None:
        self.uninstall()

    def _roots(self) -> set[str]:
        return {name.split(".")[0] for name in self._modules}

    def _names(self) -> list[str]:
        """What ``sys.modules`` holds of the host, whoever it is."""
        roots = self._roots()
        return [name for name in sys.modules if name.split(".")[0] in roots]

    def _holders(self, before: Mapping[str, ModuleType]) -> list[str]:
        """Modules whose attribute of the host's name is the former host, or None: trimesh's where the import failed."""
        names = set()
        for root in self._roots():
            former = before.get(root)
            for name, module in list(sys.modules.items()):
                held = vars(module).get(root, module) if isinstance(module, ModuleType) else module
                if held is not module and held is former:
                    names.add(name)
        return sorted(names)


class _FinderAside(MetaPathFinder):
    """Finds packages that are built on a host, to be imported while the stand-in is aside."""

    def __init__(self, stand_in: StandIn, packages: tuple[str, ...]):
        self._stand_in, self._packages = stand_in, packages

    def find_spec(self, fullname, path=None, target=None):
        if fullname.partition(".")[0] not in self._packages:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = _LoaderAside(self._stand_in, spec.loader)
        return spec


class _LoaderAside(Loader):
    """Another loader, which does its work while the stand-in is aside, and is the module's afterwards."""

    def __init__(self, stand_in: StandIn, loader: Loader):
        self._stand_in, self._loader = stand_in, loader

    def create_module(self, spec):
        with self._stand_in.aside():
            return self._loader.create_module(spec)

    def exec_module(self, module):
        module.__loader__ = module.__spec__.loader = self._loader
        with self._stand_in.aside():
            self._loader.exec_module(module)
