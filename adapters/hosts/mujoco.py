"""MuJoCo with collide's contacts: `install`, and `world`, a World of a model's geoms.

    from collide.adapters.hosts.mujoco import install
    with install(model):
        mujoco.mj_step(model, data)

MuJoCo finds the contacts of each pair of kinds of geoms by a function of a table. While installed, compiled functions
of libcollide stand in that table: no Python runs in a step, in however many threads MuJoCo steps. Geoms of other
models, and signed distance fields, go to the functions that stood there before.
"""

from __future__ import annotations

import atexit
import ctypes
from collections.abc import Iterable
from functools import cache
from threading import RLock
from typing import Any, Literal

import numpy as np

from collide import World
from collide.adapters.hosts.mujoco_geoms import Model, ModelTables, geom_shapes
from collide.adapters.hosts.mujoco_layout import BOX, OURS, Layout, N, host
from collide.adapters.hosts.mujoco_limits import max_contacts
from collide.errors import InvalidArgument, UnsupportedQuery, brief
from collide.kernels.library import library_path
from collide.kernels.mode import COMPILED, MODE, WHY
from collide.scenes.loaders.mjcf_pairs import REASONS, filtered

MODES = ("contacts", "cull")
_FLOOR = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
<body pos="0 0 .08"><freejoint/><geom type="sphere" size=".1"/></body></worldbody></mujoco>"""
_lock = RLock()
_installed: list[Installed] = []


def install(models: Any, mode: Literal["contacts", "cull"] = "contacts") -> Installed:
    """Have MuJoCo ask collide about the geoms of these models, until uninstalled.

    Parameters
    ----------
    models : a ``mujoco.MjModel``, or several. Copies that MuJoCo makes of one (``mujoco.batch``) are answered, too.
    mode : "contacts": distances, places and normals are collide's. "cull": pairs that collide proves to be farther
        apart than their margin, and a thousandth of their size more, are left out, all others are MuJoCo's: a step has
        the bits it has without, sooner.

    Returns
    -------
    Installed : a context manager; leaving it uninstalls, also after an exception. Several may be installed, one within
    another or not; of one model the latest counts. At exit of the process what is left is uninstalled.

    Raises
    ------
    InvalidArgument : no model, or no such mode.
    InvalidShape : a geom whose numbers make no shape, by its name.
    MissingExtra : mujoco is not installed.
    UnsupportedQuery : MuJoCo's version is not understood, or collide runs without its compiled library; or MuJoCo is
        older than 3.6, and models are installed in the other mode: it drops some contacts of two boxes only while its
        own function stands in the table, where "cull" leaves it and "contacts" cannot.

    Notes
    -----
    O(n) for n geoms, and what their meshes' hulls cost; the first time some 0.1 s to look at MuJoCo, while no other
    thread may step.

    A pair has at most as many contacts as MuJoCo has room for, and 8: the deepest, and those that span the greatest
    area; one with a height field has up to 50. `mj_geomDistance` asks the same functions. Changing sizes or kinds of
    geoms while installed makes the next step raise ``mujoco.FatalError``; after that, or a change of a mesh's vertices
    or of the flag MULTICCD, call `Installed.refresh`. Heights of a field may change freely.
    """
    if not isinstance(mode, str) or mode not in MODES:
        raise InvalidArgument(f"install: mode must be one of {', '.join(map(repr, MODES))}, got {brief(mode)}")
    mujoco = host().mujoco
    listed = [models] if isinstance(models, mujoco.MjModel) else list(models) if isinstance(models, Iterable) else []
    if not listed or not all(isinstance(model, mujoco.MjModel) for model in listed):
        raise InvalidArgument(f"install: models must be a mujoco.MjModel, or several, got {type(models).__name__}")
    return Installed(listed, mode)


class Installed:
    """Models that are answered by collide while this is in force.

    remaining : (model's place, geom) of geoms that are left to MuJoCo, and why.
    """

    def __init__(self, models: list, mode: str):
        self._models, self._mode = models, mode
        self._tables: list[ModelTables] = []
        self._numbers: list[int] = []
        self.remaining: dict[tuple[int, int], str] = {}
        with _lock:
            _refuse_both_modes(mode)
            self._add()
            _installed.append(self)

    def refresh(self) -> None:
        """Look at the models again, whose geoms, meshes or options were changed."""
        with _lock:
            if self not in _installed:
                raise InvalidArgument("refresh: this was uninstalled; call install() again")
            before = self._numbers
            self._numbers = []
            self._add()
            for number in before:
                _library().collide_mujoco_remove(number)

    def uninstall(self) -> None:
        """Put things back; a second time does nothing."""
        with _lock:
            if self in _installed:
                _installed.remove(self)
                self._remove()
                if not _installed:
                    _library().collide_mujoco_unhook()

    def __enter__(self) -> Installed:  # noqa: PYI034 - Self is of Python 3.11
        return self

    def __exit__(self, *_: object) -> None:
        self.uninstall()

    def _add(self) -> None:
        library = _library()
        tables = [ModelTables(model, self._mode == "cull") for model in self._models]
        if not library.collide_mujoco_hooked():
            _hook(self._mode)
        try:
            for made in tables:
                number = library.collide_mujoco_add(ctypes.byref(made.made))
                if number == -3:
                    raise MemoryError("install: no memory for another model")
                if number < 0:
                    raise UnsupportedQuery(
                        "install: too many models; at most 256 at a time" if number == -1
                        else "install: libcollide and the Python package differ; install collide-robotics again"
                    )
                self._numbers.append(number)
        except (UnsupportedQuery, MemoryError):
            self._remove()
            if not _installed:
                library.collide_mujoco_unhook()
            raise
        self._tables = tables
        self.remaining = {(k, geom): why for k, made in enumerate(tables) for geom, why in made.remaining.items()}

    def _remove(self) -> None:
        for number in self._numbers:
            _library().collide_mujoco_remove(number)
        self._numbers = []


def is_hooked() -> bool:
    """Whether functions of MuJoCo's table are collide's now."""
    return bool(_installed) and _library().collide_mujoco_hooked() > 0


@cache
def _library() -> ctypes.CDLL:
    if MODE != COMPILED:
        raise UnsupportedQuery(f"install: MuJoCo needs collide's compiled library, which is not in use here: {WHY}")
    library = ctypes.CDLL(library_path())
    library.collide_mujoco_hook.argtypes = [
        ctypes.POINTER(Layout), ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p,
    ]
    library.collide_mujoco_add.argtypes = [ctypes.POINTER(Model)]
    library.collide_mujoco_remove.argtypes = [ctypes.c_int]
    for name in ("unhook", "remove"):
        getattr(library, f"collide_mujoco_{name}").restype = None
    atexit.register(_uninstall_all)
    return library


def _refuse_both_modes(mode: str) -> None:
    others = {in_force._mode for in_force in _installed} - {mode}
    if others and host().drops_of_boxes:
        raise UnsupportedQuery(
            f"install: mode {mode!r} while models are installed in mode {others.pop()!r}: MuJoCo "
            f"{host().mujoco.__version__} drops some contacts of two boxes only while its own function stands in its "
            "table, so that modes exclude each other; uninstall the others first, or use MuJoCo 3.6 or later"
        )


def _hook(mode: str) -> None:
    loaded = host()
    max_contacts((0, 0))  # a version that does not tell is refused here
    replaced = np.zeros((N, N), dtype=np.uint8)
    for i in OURS:
        replaced[i, [j for j in OURS if i <= j]] = 1
    if mode == "cull" and loaded.drops_of_boxes:  # culling leaves two boxes to MuJoCo in any version: nothing is lost
        replaced[BOX, BOX] = 0
    error = ctypes.cast(loaded.library.mju_error, ctypes.c_void_p)
    if _library().collide_mujoco_hook(ctypes.byref(loaded.layout), loaded.table, replaced.ctypes.data, error):
        # All our functions were overwritten by somebody since: begin again on what stands there now.
        _library().collide_mujoco_unhook()
        _library().collide_mujoco_hook(ctypes.byref(loaded.layout), loaded.table, replaced.ctypes.data, error)


def check() -> str:
    """Install on a ball in a floor, look at its contact, uninstall: one line for `collide doctor`.

    Raises
    ------
    RuntimeError : what does not hold.   MissingExtra, UnsupportedQuery : as of `install`.
    """
    mujoco = host().mujoco
    model = mujoco.MjModel.from_xml_string(_FLOOR)
    data = mujoco.MjData(model)
    with install(model):
        mujoco.mj_forward(model, data)
        depths = [contact.dist for contact in data.contact]
        hooked = is_hooked()
    if not hooked or len(depths) != 1 or abs(depths[0] + 0.02) > 1e-12:
        raise RuntimeError(f"a ball 0.02 m deep in a floor, hooked {hooked}: contacts of distance {depths}")
    if is_hooked():
        raise RuntimeError("functions of MuJoCo's table are still collide's after uninstalling")
    return f"the layout of MuJoCo {mujoco.__version__} is understood, a step had our contact, uninstalled cleanly"


def _uninstall_all() -> None:
    while _installed:
        _installed[-1].uninstall()


def world(model: Any, data: Any = None) -> World:
    """A World of a model's geoms that collide, at the poses of its data.

    Parameters
    ----------
    model : ``mujoco.MjModel``.
    data : ``mujoco.MjData`` whose ``geom_xpos`` and ``geom_xmat`` are up to date (``mj_kinematics``); without, those
        of the model's first configuration.

    Returns
    -------
    World : bodies named as the geoms, or "geom 7"; those that are fixed to the world are static. Pairs that MuJoCo
    never tests are allowed: of one body, of a body and its parent, excluded, or by contype and conaffinity; all,
    where the model's option turns contacts or constraints off. Signed distance fields are left out.

    Raises
    ------
    MissingExtra, InvalidArgument, InvalidShape.

    Notes
    -----
    O(n²) for n geoms, for what is allowed.
    """
    mujoco = host().mujoco
    if not isinstance(model, mujoco.MjModel):
        raise InvalidArgument(f"world: model must be a mujoco.MjModel, got {type(model).__name__}")
    if data is None:
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
    elif not isinstance(data, mujoco.MjData) or len(data.geom_xpos) != model.ngeom:
        raise InvalidArgument(f"world: data must be a mujoco.MjData of this model, or None, got {brief(data)}")
    shapes, rows, _ = geom_shapes(model)
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    collides[[*model.pair_geom1.tolist(), *model.pair_geom2.tolist()]] = True
    geoms = np.flatnonzero((rows >= 0) & collides)
    out = World()
    welded = model.body_weldid[model.geom_bodyid]
    for geom in geoms.tolist():
        X_WG = np.eye(4)
        X_WG[:3, :3], X_WG[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
        out.add(shapes[rows[geom]], X_WG, name=model.geom(geom).name or f"geom {geom}", static=bool(welded[geom] == 0))
    if len(geoms):
        codes = filtered(model, geoms)
        np.fill_diagonal(codes, 0)
        for code in np.unique(codes[codes > 0]).tolist():
            out.allow(codes == code, reason=f"never tested by MuJoCo: {REASONS[code]}")
    return out
