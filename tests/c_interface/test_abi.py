"""The binary interface of libcollide is the committed one, and what would break programs is noticed."""

from __future__ import annotations

import shutil
import struct
import sys
from pathlib import Path

import abi
import pytest

from collide.kernels import mode
from collide.kernels.library import library_path

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)
if not sys.platform.startswith("linux") or struct.calcsize("P") != 8:
    pytest.skip("sizes and symbols are those of Linux of 64 bits", allow_module_level=True)


def described(folder: Path, header: str | None = None) -> str:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or shutil.which("nm") is None:
        pytest.skip("no C compiler, or no nm")
    return abi.described(Path(library_path()), compiler, folder, header)


def test_binary_interface_is_the_committed_one(tmp_path):
    told = abi.differences(described(tmp_path))
    assert not told, f"{abi.ADVICE}\n{told}"


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ("double lower, upper;", "double upper, lower;", "+    upper at 8: 8 bytes"),
        ("uint8_t beyond;", "uint8_t beyond; double more;", "+structure collide_pair: 168 bytes"),
        ("COLLIDE_TOO_MANY = 9", "COLLIDE_TOO_MANY = 11", "-constant COLLIDE_TOO_MANY 9"),
        ("collide_sphere(double radius", "collide_sphere(float radius", "-function collide_status collide_sphere("),
        ("collide_cone(", "collide_spike(", "+missing collide_spike"),
    ],
)
def test_what_breaks_programs_is_noticed(tmp_path, old, new, wanted):
    header = abi.HEADER.read_text(encoding="utf-8")
    assert old in header
    assert wanted in abi.differences(described(tmp_path, header.replace(old, new, 1)))


def test_every_structure_and_constant_is_described():
    header = abi.HEADER.read_text(encoding="utf-8")
    assert set(abi.structures(header)) >= {"collide_pair", "collide_contact", "collide_body", "collide_world_hit"}
    begun = [line for line in header.splitlines() if line.startswith("typedef struct") and line.endswith("{")]
    assert len(abi.structures(header)) == len(begun)
    assert {"COLLIDE_OK", "COLLIDE_MOTION_COLLIDES", "COLLIDE_START_NORMALS"} <= set(abi.constants(header))
