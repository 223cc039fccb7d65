"""Where MuJoCo keeps what the functions of its collision table read and write, found out by looking.

MuJoCo's structures change from version to version. Arrays' addresses are known to Python: where a structure holds one
is where a field stands. What a function of the table writes is found in the contacts of a model whose contacts are
known.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from collide.errors import MissingExtra, UnsupportedQuery

#: Kinds of geoms (mjtGeom): the table has a function for every two, the smaller number first.
KINDS = ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
PLANE, FIELD, BOX = KINDS.index("plane"), KINDS.index("hfield"), KINDS.index("box")
N = len(KINDS)
#: Kinds that are ours.
OURS = tuple(KINDS.index(name) for name in KINDS if name != "sdf")
#: Bytes that a structure is looked through for at most.
_MODEL_BYTES, _DATA_BYTES = 1 << 16, 1 << 20

_FUNCTION = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_double
)

TRIAL = """<mujoco><asset><mesh name="t" vertex="0 0 0 .2 0 0 0 .2 0 0 0 .2"/>
<hfield name="t" nrow="2" ncol="2" size="1 1 1 1"/></asset><worldbody>
<geom type="plane" size="1 1 1"/><body pos=".3 .1 .09"><freejoint/><geom type="box" size=".1 .12 .1"/></body>
<body pos="0 5 5"><freejoint/><geom type="mesh" mesh="t"/></body></worldbody></mujoco>"""


#: Arrays of a model that are read in a step.
ARRAYS = ("geom_type", "geom_dataid", "geom_size", "mesh_vert", "hfield_size", "hfield_data")


class Layout(ctypes.Structure):
    """`collide_mujoco_layout` of native/host_mujoco.h: offsets in bytes."""

    _fields_ = [
        (name, ctypes.c_int64)
        for name in (
            *ARRAYS, "signature", "geom_xpos", "geom_xmat", "contact_size",
        )
    ]


class Host(NamedTuple):
    """MuJoCo as it is loaded.

    table : its functions, N * N addresses.   error : the address of `mju_error`.
    has_limits : whether MuJoCo refuses more contacts of a pair than it expects (since its mjPreContact).
    drops_of_boxes : whether MuJoCo drops some contacts of two boxes only while its own function stands in the table
        (before 3.6).
    """

    mujoco: Any
    library: ctypes.CDLL
    table: Any
    layout: Layout
    has_limits: bool
    drops_of_boxes: bool


@cache
def host() -> Host:
    """MuJoCo, looked at once a process.

    Raises MissingExtra, and UnsupportedQuery where a version holds things otherwise than is understood.
    """
    try:
        import mujoco
    except ImportError:
        raise MissingExtra("mujoco", extra="mujoco", purpose="run MuJoCo with collide's contacts") from None
    library = _library(mujoco)
    table = (ctypes.c_void_p * (N * N)).in_dll(library, "mjCOLLISIONFUNC")
    layout = _offsets(mujoco)
    layout.contact_size = _contact_size(mujoco, table)
    # A row shorter than MuJoCo's own contacts: those since 3.9, with as many as each pair may have.
    return Host(mujoco, library, table, layout, layout.contact_size < 128, _drops_of_boxes(mujoco, table))


def refused(mujoco, what: str) -> UnsupportedQuery:
    return UnsupportedQuery(
        f"MuJoCo {mujoco.__version__}: {what}; this version cannot be hooked, use one from 3.3 to 4.0, or MuJoCo alone"
    )


def _library(mujoco) -> ctypes.CDLL:
    """MuJoCo's library that the Python module has loaded."""
    folder = Path(mujoco.__file__).parent
    names = {"win32": "mujoco.dll", "darwin": "libmujoco*.dylib"}
    files = sorted(folder.glob(names.get(sys.platform, "libmujoco.so*")))
    if not files:
        raise refused(mujoco, f"no library in {folder}")
    library = ctypes.CDLL(str(files[0]))
    for name in ("mjCOLLISIONFUNC", "mju_error", "mj_version"):
        if not hasattr(library, name):
            raise refused(mujoco, f"{files[0].name} has no {name}")
    if library.mj_version() != mujoco.mj_version():
        raise refused(mujoco, f"{files[0].name} is of another version")
    return library


def _bytes_at(address: int, n: int) -> bytes:
    """Up to n bytes of this process; fewer where no memory follows."""
    try:
        memory = os.open("/proc/self/mem", os.O_RDONLY)
    except OSError:
        return ctypes.string_at(address, n)
    try:
        out = b""
        while len(out) < n:
            at = address + len(out)
            out += os.pread(memory, min(n - len(out), 4096 - at % 4096), at)
    except OSError:
        pass
    finally:
        os.close(memory)
    return out


def _where(mujoco, address: int, limit: int, wanted: dict[str, int]) -> dict[str, int]:
    """Offsets of 8-byte values in a structure.

    Arrays stand one behind another in the order of their fields, so that empty ones before an array share its address:
    the last field is that of the array. `ModelTables` compares with the addresses of the model it is made for.
    """
    seen = b""
    while len(seen) < limit:
        seen += _bytes_at(address + len(seen), 2048)
        words = np.frombuffer(seen[: len(seen) // 8 * 8], dtype=np.uint64)
        hits = {name: np.flatnonzero(words == np.uint64(value)) for name, value in wanted.items()}
        if all(len(hit) for hit in hits.values()) or len(seen) % 2048:
            break
    end = int(hits["signature"][0]) if "signature" in hits and len(hits["signature"]) else len(words)
    for name, hit in hits.items():
        hits[name] = hit = hit[hit <= end]  # a model's signature is its last field: what follows is other memory
        if not len(hit) or np.ptp(hit) >= len(hit):
            raise refused(mujoco, f"{name} stands in {len(hit)} places instead of one")
    return {name: 8 * int(hit[-1]) for name, hit in hits.items()}


def _offsets(mujoco) -> Layout:
    """All but `contact_size`, the same from two models."""
    layouts = []
    for text in (TRIAL, TRIAL.replace("</worldbody>", '<geom type="sphere" size=".1" pos="9 9 9"/></worldbody>')):
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        if not (hasattr(model, "_address") and hasattr(data, "_address") and hasattr(model, "signature")):
            raise refused(mujoco, "its models tell no address or no signature")
        types = [getattr(model, name).dtype for name in ("geom_size", "hfield_size", "geom_type", "hfield_data")]
        if types != [np.float64, np.float64, np.int32, np.float32]:
            raise refused(mujoco, "its numbers are of other types")
        wanted = {name: getattr(model, name).ctypes.data for name in ARRAYS} | {"signature": model.signature}
        of_data = {name: getattr(data, name).ctypes.data for name in ("geom_xpos", "geom_xmat")}
        layouts.append(
            _where(mujoco, model._address, _MODEL_BYTES, wanted)
            | _where(mujoco, data._address, _DATA_BYTES, of_data)
        )
    if layouts[0] != layouts[1]:
        raise refused(mujoco, "two models are laid out differently")
    return Layout(**layouts[0])


def check_model(model) -> None:
    """Raises UnsupportedQuery where arrays of a model do not stand where they were found."""
    layout = host().layout
    for name in ARRAYS:
        array = getattr(model, name)
        (stands,) = struct.unpack("<Q", ctypes.string_at(model._address + getattr(layout, name), 8))
        if array.size and stands != array.ctypes.data:
            raise refused(host().mujoco, f"{name} of this model is not where it was in others")


@contextmanager
def instead(table, index: int, function):
    """A Python function in one place of the table."""
    before, callback = table[index], _FUNCTION(function)
    table[index] = ctypes.cast(callback, ctypes.c_void_p).value
    try:
        yield
    finally:
        table[index] = before


def _contact_size(mujoco, table) -> int:
    """How far apart contacts stand that a function writes.

    A box on a plane has four, and MuJoCo tells them afterwards.
    """
    model = mujoco.MjModel.from_xml_string(TRIAL)
    data = mujoco.MjData(model)
    index, written = N * PLANE + BOX, []
    original = _FUNCTION(table[index])

    def look(of_model, of_data, contacts, g1, g2, margin):
        n = original(of_model, of_data, contacts, g1, g2, margin)
        written.append((n, _bytes_at(contacts, 8192)))
        return n

    with instead(table, index, look):
        mujoco.mj_forward(model, data)
    if len(written) != 1 or written[0][0] != 4 or data.ncon != 4:
        raise refused(mujoco, "a function put into its collision table is not called")
    known = {struct.pack("<7d", contact.dist, *contact.pos, *contact.frame[:3]) for contact in data.contact}
    seen = written[0][1]
    sizes = [s for s in range(80, 2049, 8) if {seen[k * s : k * s + 56] for k in range(4)} == known]
    if len(known) != 4 or len(sizes) != 1:
        raise refused(mujoco, f"contacts of a known pair were found at {len(sizes)} distances instead of one")
    return sizes[0]


def _drops_of_boxes(mujoco, table) -> bool:
    """Whether two boxes have other contacts where a function that hands them to MuJoCo's own stands in its place.

    Of level boxes at 32 places: MuJoCo 3.3 to 3.5 drop contacts of a fourth of them.
    """
    box = '<body><freejoint/><geom type="box" size=".06 .05 .07"/></body>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{box}{box}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    index, random = N * BOX + BOX, np.random.default_rng(0)
    places = random.uniform(-0.07, 0.07, (32, 3))
    handed_on = _FUNCTION(table[index])

    def counts() -> list[int]:
        numbers = []
        for place in places:
            data.qpos[7:10] = place
            mujoco.mj_fwdPosition(model, data)
            numbers.append(int(data.ncon))
        return numbers

    alone = counts()
    with instead(table, index, lambda *asked: handed_on(*asked)):
        return counts() != alone
