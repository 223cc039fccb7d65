"""What pyproject.toml cannot say: which folders are packages, kernels to compile, numba where they cannot be."""

import os
import sys
from pathlib import Path

from setuptools import find_packages, setup

sys.path.insert(0, str(Path(__file__).resolve().parent / "native"))
from build_library import FOR, BuildLibrary, extension, why_not

os.environ.setdefault("SOURCE_DATE_EPOCH", "1577836800")  # the same sources give the same wheel, byte by byte
compiled = not why_not()
folders = {"collide": "collide", "collide.adapters": "adapters", "collide.scenes": "scenes"}
setup(
    package_dir=folders,
    packages=[*folders, *(f"{name}.{part}" for name, folder in folders.items() for part in find_packages(folder))],
    ext_modules=[extension()] if compiled else [],
    cmdclass={"build_ext": BuildLibrary},
    options=FOR.options() if compiled else {},
    install_requires=["numpy>=1.24", *([] if compiled else ["numba==0.68.*", "llvmlite==0.50.*"])],
)
