"""Builds libtrefoil and the launcher by cargo, and puts them into the package.

TREFOIL_BUILT names a folder that already has both files; cargo then builds nothing.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

TOP = Path(__file__).resolve().parent.parent
FILES = ("libtrefoil.so", "trefoil")


def built() -> Path:
    """Returns the folder of the built files."""
    if folder := os.environ.get("TREFOIL_BUILT"):
        return Path(folder)
    cargo = ["cargo", "build", "--release", "-p", "trefoil", "-p", "launcher"]
    try:
        subprocess.run(cargo, cwd=TOP, check=True)
    except FileNotFoundError:
        sys.exit("cargo is missing: install Rust from https://rustup.rs")
    return Path(os.environ.get("CARGO_TARGET_DIR", TOP / "target")) / "release"


class BuildWithCargo(build_py):
    def run(self) -> None:
        super().run()
        for file in FILES:
            shutil.copy2(built() / file, Path(self.build_lib) / "trefoil" / file)


class Binary(Distribution):
    """Package whose wheel is for this platform only."""

    def has_ext_modules(self) -> bool:
        return True


SCRATCH = TOP / "target" / "python"
SCRATCH.mkdir(parents=True, exist_ok=True)
setup(
    cmdclass={"build_py": BuildWithCargo},
    distclass=Binary,
    options={"build": {"build_base": str(SCRATCH)}, "egg_info": {"egg_base": str(SCRATCH)}},
)
