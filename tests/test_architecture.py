"""Dependencies run one way: every import statement of the package, held to one table of layers."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import rbimpedance

from .isolation import fresh_python

SOURCES = Path(rbimpedance.__file__).parent

LAYERS = (
    ("exceptions",),
    ("_common",),
    ("_numba",),
    ("law",),
    ("robot",),
    ("trajectories",),
    ("interaction",),
    ("control",),
    ("logs",),
    ("simulation",),
    ("tuning",),
    ("study",),
    ("hardware",),
    ("pictures",),
    ("__init__",),
    ("cli",),
    ("__main__",),
)
"""Rooms from the lowest layer up. A module imports from its own room and from lower layers, nothing else."""

PURE = {"exceptions", "_common", "law"}  # the mathematics: NumPy and SciPy only
KNOW_PINOCCHIO = {"robot", "pictures", "cli"}
HEAVY = (
    *("dask", "distributed", "matplotlib", "mcap", "meshcat", "mujoco", "numba", "pyarrow", "rich"),
    *("rosbags", "typer", "yourdfpy"),
)
MODULES = {
    ".".join(path.relative_to(SOURCES).with_suffix("").parts): path
    for path in sorted(SOURCES.rglob("*.py"))
}
FILES = {name.removesuffix(".__init__"): path for name, path in MODULES.items()}
ROOMS = sorted({name.partition(".")[0] for name in FILES})


def _imported(path: Path) -> Iterator[str]:
    """Dotted names of all that a module imports, for type checkers and inside functions, too."""
    package = path.relative_to(SOURCES.parent).parent.parts
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*parents, *([node.module] if node.module else [])])
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _file_of(name: str) -> str | None:
    """The module of the package that holds an imported name."""
    inside = name.removeprefix("rbimpedance.")
    if inside == name:
        return None
    return inside if inside in FILES else inside.rpartition(".")[0] or "__init__"


IMPORTS = {name: set(_imported(path)) for name, path in FILES.items()}
ARROWS = {
    name: {target for each in names if (target := _file_of(each)) not in {None, name}}
    for name, names in IMPORTS.items()
}


def _layer(module: str | None) -> int:
    room = (module or "").partition(".")[0]
    return next(i for i, layer in enumerate(LAYERS) if room in layer)


def _libraries(room: str) -> set[str]:
    names = {
        each.partition(".")[0]
        for module, imported in IMPORTS.items()
        if module.partition(".")[0] == room
        for each in imported
    }
    return names - set(sys.stdlib_module_names) - {"rbimpedance"}


def test_every_room_has_a_layer_and_every_layer_a_room() -> None:
    assert sorted(room for layer in LAYERS for room in layer) == ROOMS


@pytest.mark.parametrize("module", sorted(FILES))
def test_module_imports_nothing_from_a_layer_above_it(module: str) -> None:
    above = {target for target in ARROWS[module] if _layer(target) > _layer(module)}
    beside = {
        target
        for target in ARROWS[module]
        if target
        and _layer(target) == _layer(module)
        and target.partition(".")[0] != module.partition(".")[0]
    }
    assert above | beside == set()


def test_modules_import_each_other_in_no_circle() -> None:
    """A package's `__init__` offers what its modules hold: who imports from it imports those modules."""
    TopologicalSorter(ARROWS).prepare()


@pytest.mark.parametrize("room", sorted(PURE))
def test_mathematics_needs_numpy_and_scipy_only(room: str) -> None:
    assert _libraries(room) <= {"numpy", "scipy"}


@pytest.mark.parametrize("room", sorted(set(ROOMS) - KNOW_PINOCCHIO))
def test_room_does_not_know_pinocchio(room: str) -> None:
    assert "pinocchio" not in _libraries(room)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "unneeded"),
    [
        ("import rbimpedance", HEAVY),
        ("import rbimpedance.control.compiled", ("numba",)),
        ("import rbimpedance; rbimpedance.load_robot('panda')", ("yourdfpy",)),
        ("import rbimpedance.cli.app", ("dask", "distributed", "matplotlib", "meshcat", "pyarrow")),
    ],
)
def test_what_is_not_needed_is_not_loaded(work: str, unneeded: tuple[str, ...]) -> None:
    run = fresh_python(f"import sys; {work}; print(*(set({unneeded!r}) & set(sys.modules)))")
    assert run.stdout.strip() == ""
