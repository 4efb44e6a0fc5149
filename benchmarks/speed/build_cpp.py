"""The C++ loop of cpp/, built against the headers and libraries of the wheels."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path

import pinocchio as pin

from .environments import cache_folder, environment
from .workers import WorkerError

FLAGS = ("-O3", "-DNDEBUG", "-std=c++17")
"""No -march=native: Eigen would align arrays otherwise than the library does, and crash."""

_URDFDOM_HEADERS = "3.0.0"
_DEFINITIONS = (
    "PINOCCHIO_ENABLE_TEMPLATE_INSTANTIATION",
    "PINOCCHIO_WITH_URDFDOM",
    *(
        f"PINOCCHIO_URDFDOM_HEADERS_{part}_VERSION={number}"
        for part, number in zip(
            ("MAJOR", "MINOR", "PATCH"), _URDFDOM_HEADERS.split("."), strict=True
        )
    ),
    "BOOST_MPL_LIMIT_LIST_SIZE=30",
    "BOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "BOOST_FUSION_INVOKE_MAX_ARITY=12",
)
_LIBRARIES = ("pinocchio_parsers", "pinocchio_default")


def compiler() -> str:
    """Return the C++ compiler: `CXX`, or the first of c++, g++ and clang++ that there is.

    Raises:
        WorkerError: There is none.
    """
    for name in (os.environ.get("CXX"), "c++", "g++", "clang++"):
        if name and (found := shutil.which(name)):
            return found
    raise WorkerError("no C++ compiler here (CXX, c++, g++, clang++)")


def build(source: Path) -> Path:
    """Return the program that a source makes; built once for each source, compiler and version of Pinocchio.

    Raises:
        WorkerError: There is no compiler, the headers do not install, or the source does not compile.
    """
    program, prefix = compiler(), _prefix()
    identity = "".join([program, pin.__version__, *FLAGS, source.read_text(encoding="utf-8")])
    target = cache_folder() / f"{source.stem}-{hashlib.sha256(identity.encode()).hexdigest()[:16]}"
    if target.is_file():
        return target
    include = prefix / "include"
    folders = (include, include / "eigen3", include / "urdfdom_headers")
    command = [
        *(program, *FLAGS),
        *(f"-D{definition}" for definition in _DEFINITIONS),
        *(part for folder in folders for part in ("-isystem", folder)),
        *(source, "-o", target, f"-L{prefix / 'lib'}", f"-Wl,-rpath,{prefix / 'lib'}"),
        *(f"-l{library}" for library in _LIBRARIES),
    ]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        errors = [line for line in run.stderr.splitlines() if "error" in line]
        raise WorkerError(f"does not compile: {errors[0] if errors else run.stderr[-200:]}")
    return target


def _prefix() -> Path:
    """Folder of headers and libraries: this environment's where it has Eigen's, else one that is made for it."""
    here = next(p for p in Path(pin.__file__).parents if p.name == "cmeel.prefix")
    if (here / "include/eigen3").is_dir() and (here / "include/urdfdom_headers").is_dir():
        return here
    requirements = (
        *(f"pin=={pin.__version__}", f"libpinocchio=={version('libpinocchio')}"),
        *("cmeel-eigen>=3.4", f"cmeel-urdfdom-headers=={_URDFDOM_HEADERS}"),
    )
    python = environment("cpp", requirements)
    return next((python.parents[1] / "lib").glob("python*/site-packages/cmeel.prefix"))
