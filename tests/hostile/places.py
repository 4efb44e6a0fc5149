"""Paths that lead to no file or out of the robot's folder, of descriptions and of meshes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .case import ARM, Case, Make, change, given, of_bytes, spoiled


def places() -> Iterator[Case]:  # noqa: C901 (one after the other)
    def at(name: str, make: Make, outcome: str, word: str, **arguments: Any) -> Case:
        return Case(name, make, outcome, word, arguments)

    def fifo(folder: Path) -> Path:
        os.mkfifo(folder / "arm.urdf")
        return folder / "arm.urdf"

    def loop(folder: Path) -> Path:
        (folder / "arm.urdf").symlink_to(folder / "arm.urdf")
        return folder / "arm.urdf"

    def dangling(folder: Path) -> Path:
        (folder / "arm.urdf").symlink_to(folder / "gone.urdf")
        return folder / "arm.urdf"

    def linked(folder: Path) -> Path:
        (folder / "true.urdf").write_text(ARM)
        (folder / "arm.urdf").symlink_to(folder / "true.urdf")
        return folder / "arm.urdf"

    def to_device(folder: Path) -> Path:
        (folder / "arm.urdf").symlink_to("/dev/zero")
        return folder / "arm.urdf"

    def below_a_file(folder: Path) -> Path:
        (folder / "arm.urdf").write_text(ARM)
        return folder / "arm.urdf" / "arm.urdf"

    def forbidden(folder: Path) -> Path:
        (folder / "arm.urdf").write_text(ARM)
        (folder / "arm.urdf").chmod(0)
        if os.getuid() == 0:  # who may read everything
            os.seteuid(65534)
        return folder / "arm.urdf"

    def nowhere(folder: Path) -> str:
        gone = folder / "gone"
        gone.mkdir()
        os.chdir(gone)
        gone.rmdir()
        return "./arm.urdf"

    def sparse(folder: Path) -> Path:
        with (folder / "arm.urdf").open("wb") as file:
            file.truncate(2**40)
        return folder / "arm.urdf"

    yield at("FIFO", fifo, "ModelError", "not a regular file")
    yield at("folder", lambda folder: folder, "ModelError", "is a folder")
    for device in ("/dev/zero", "/dev/null", "/dev/random", "/dev/full", "/dev/tty"):
        yield at(device, given(device), "ModelError", "not a regular file")
    yield at("link to a device", to_device, "ModelError", "not a regular file")
    yield at("link in a circle", loop, "ModelError", "cannot be read")
    yield at("link to nothing", dangling, "ModelError", "no file")
    yield at("link to a file", linked, "sound", "")
    yield at("file as a folder", below_a_file, "ModelError", "cannot be read")
    yield at("permission denied", forbidden, "ModelError", "cannot be read.*[Pp]ermission")
    yield at("missing file", lambda folder: folder / "arm.urdf", "ModelError", "there is no file")
    yield at("missing folder", lambda folder: folder / "a" / "arm.urdf", "ModelError", "no folder")
    yield at("working folder deleted", nowhere, "ModelError", "no file")
    yield at("file of a terabyte", sparse, "ModelError", "bytes: that is no URDF")
    yield at("/proc/self/mem", lambda _: "/proc/self/mem", "ModelError", "cannot be read|regular")
    yield at("NUL in a path", lambda _: "a\0b.urdf", "ModelError", "cannot be read")
    yield at(
        "path of 10000 letters", lambda _: "x" * 10_000 + ".urdf", "ModelError", "cannot be read"
    )
    yield at(
        "path with an escape",
        lambda folder: str(folder / "\x1b[31m.urdf"),
        "ModelError",
        r"\\x1b\[31m",
    )
    yield at(
        "name with an escape, long", lambda _: "\x1b[31m" * 100, "ModelError", "no robot is called"
    )
    yield at(
        "path with a lone surrogate",
        lambda _: "\udc80\ud800.urdf",
        "ModelError",
        "cannot be read|no file",
    )


# --- meshes -----------------------------------------------------------------------------------------------------


def _many_meshes() -> str:
    mesh = '<visual><geometry><mesh filename="{}.stl"/></geometry></visual>'
    return '<link name="tool">' + "".join(mesh.format(i) for i in range(30_000)) + "</link>"


def meshes() -> Iterator[Case]:
    addresses = {
        "absolute": "/etc/passwd",
        "file": "file:///etc/passwd",
        "climbing": "../../../../../../../../etc/passwd",
        "climbing package": "package://arm/../../../../../../etc/passwd",
        "package of the root": "package://etc/passwd",
        "device": "file:///dev/zero",
        "http": "http://127.0.0.1:9/a.stl",
        "of 5000 letters": "package://" + "a" * 5000 + ".stl",
        "with an escape": "&#x9b;31m.stl",
        "empty": "",
        "of a home": "~/a.stl",
        "NUL by percent": "file:///etc/passwd%00.stl",
        "no scheme at all": "://a.stl",
    }
    for name, address in addresses.items():
        visual = f'<link name="tool"><visual><geometry><mesh filename="{address}"/></geometry></visual></link>'
        text = spoiled(('<link name="tool"/>', visual)).encode()
        yield of_bytes(f"mesh {name}", text, "sound", "1 of 1 mesh files are missing, or outside")
    yield change(
        "30000 meshes", '<link name="tool"/>', _many_meshes, "sound", "30000 mesh files are named"
    )
    for name, shape in {
        "negative scale": '<mesh filename="a.stl" scale="-1 -1 -1"/>',
        "zero scale": '<mesh filename="a.stl" scale="0 0 0"/>',
        "nan scale": '<mesh filename="a.stl" scale="nan nan nan"/>',
        "scale in words": '<mesh filename="a.stl" scale="big"/>',
        "negative radius": '<sphere radius="-1"/>',
        "no radius": "<sphere/>",
        "box of two": '<box size="1 2"/>',
        "unknown shape": "<torus/>",
        "nothing": "",
        "mesh without file": "<mesh/>",
    }.items():
        visual = f'<link name="tool"><visual><geometry>{shape}</geometry></visual></link>'
        yield change(f"shape {name}", '<link name="tool"/>', visual, "sound", "")


GROUPS = (places, meshes)
