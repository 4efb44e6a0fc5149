"""Dependencies run one way: the import statements of the package, held to the design's layers."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "rbimpedance"

LAYERS: tuple[frozenset[str], ...] = (
    frozenset(
        {"exceptions", "_arrays", "_description", "_files", "_frozen", "_leaf", "_suggestions"}
    ),
    frozenset(
        {
            "impedance",
            "variable_impedance",
            "finite_time",
            "_homogeneous",
            "surfaces",
            "bounded_surface",
            "super_twisting",
        }
    ),
    frozenset({"stability", "_certificate_words", "_lyapunov"}),
    frozenset({"pinocchio_dynamics", "rigid_bodies"}),
    frozenset({"dynamics"}),
    frozenset({"loading", "trajectories", "interaction", "cartesian"}),
    frozenset({"robots", "model_building"}),
    frozenset({"limits", "telemetry", "compiled"}),
    frozenset({"controller", "lean", "tracking", "reference_guard", "baselines", "_baseline"}),
    frozenset({"result", "energy", "observers", "estimators", "encoders", "loop"}),
    frozenset({"safety"}),
    frozenset({"snapshot", "checkpointing"}),
    frozenset({"plants"}),
    frozenset({"simulation"}),
    frozenset({"scenarios", "tuning", "study"}),
    frozenset(
        {
            "plotting",
            "_analysis_figures",
            "_figure_style",
            "benchmarking",
            "viewing",
            "visualization",
            "cli",
            "_report",
            "_study_command",
            "_study_figures",
            "_study_report",
            "_tuning_report",
            "_terminal",
            "__main__",
        }
    ),
)
PURE = LAYERS[0] | LAYERS[1] | LAYERS[2]  # the mathematics: NumPy and SciPy only
KNOW_PINOCCHIO = {
    "robots",
    "model_building",
    "dynamics",
    "pinocchio_dynamics",
    "rigid_bodies",
    "viewing",
    "benchmarking",
}
HEAVY = (
    *("dask", "distributed", "matplotlib", "meshcat", "mujoco", "numba", "pyarrow", "rich"),
    *("typer", "yourdfpy"),
)


def _at_run_time(tree: ast.AST) -> Iterator[ast.AST]:
    """Every node, without those that only type checkers see."""
    yield tree
    for child in ast.iter_child_nodes(tree):
        is_for_checkers = isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"
        if not is_for_checkers:
            yield from _at_run_time(child)


def _imports(path: Path) -> set[str]:
    """Dotted names of everything that a module imports, those of the package in full."""
    package = path.relative_to(PACKAGE.parent).parent.parts
    found: set[str] = set()
    for node in _at_run_time(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*parents, *([node.module] if node.module else [])])
            found |= {f"{base}.{alias.name}" for alias in node.names}
    return found


def _package_imports(path: Path) -> set[str]:
    """What a sub-package imports, with all that is in it."""
    return set().union(*(_imports(module) for module in path.rglob("*.py")))


IMPORTS = {path.stem: _imports(path) for path in sorted(PACKAGE.glob("*.py"))}
IMPORTS |= {
    path.parent.name: _package_imports(path.parent) for path in PACKAGE.glob("*/__init__.py")
}
MODULES = sorted(set(IMPORTS) - {"__init__"})


def _siblings(module: str) -> set[str]:
    names = {name.split(".")[1] for name in IMPORTS[module] if name.startswith("rbimpedance.")}
    return names & set(IMPORTS) - {module}


def _libraries(module: str) -> set[str]:
    names = {name.split(".")[0] for name in IMPORTS[module]}
    return names - set(sys.stdlib_module_names) - {"rbimpedance"}


def _layer(module: str) -> int:
    return next(i for i, layer in enumerate(LAYERS) if module in layer)


def test_every_module_has_a_layer() -> None:
    assert sorted(set(MODULES) - frozenset().union(*LAYERS)) == []


@pytest.mark.parametrize("module", MODULES)
def test_module_imports_nothing_from_a_layer_above_it(module: str) -> None:
    assert [name for name in _siblings(module) if _layer(name) > _layer(module)] == []


def test_imports_have_no_cycle() -> None:
    TopologicalSorter({module: _siblings(module) for module in MODULES}).prepare()


@pytest.mark.parametrize("module", sorted(PURE & set(MODULES)))
def test_mathematics_needs_numpy_and_scipy_only(module: str) -> None:
    assert _libraries(module) <= {"numpy", "scipy"}


@pytest.mark.parametrize("module", sorted(set(MODULES) - KNOW_PINOCCHIO))
def test_module_does_not_know_pinocchio(module: str) -> None:
    assert "pinocchio" not in _libraries(module)


def test_package_offers_no_leaf() -> None:
    assert _siblings("__init__") & LAYERS[-1] == set()


def test_leaves_are_reached_from_below_through_one_module_only() -> None:
    reaching = {module for module in IMPORTS if "_leaf" in _siblings(module)}
    assert reaching == {"__init__", "result"}


def test_importing_the_package_loads_no_heavy_library() -> None:
    code = f"import sys, rbimpedance; print(*(set({HEAVY!r}) & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == ""
