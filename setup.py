"""What pyproject.toml cannot say: kernels are compiled, and where they cannot be, the package needs numba."""

import os
import sys
from pathlib import Path

from setuptools import setup

sys.path.insert(0, str(Path(__file__).resolve().parent / "native"))
from build_library import BuildLibrary, extension, why_not

os.environ.setdefault("SOURCE_DATE_EPOCH", "1577836800")  # the same sources give the same wheel, byte by byte
compiled = not why_not()
setup(
    ext_modules=[extension()] if compiled else [],
    cmdclass={"build_ext": BuildLibrary},
    options={"bdist_wheel": {"py_limited_api": "cp310"}} if compiled else {},
    install_requires=["numpy>=1.24", *([] if compiled else ["numba==0.68.*", "llvmlite==0.50.*"])],
)
