"""Every notebook runs, holds what its last cell claims, and is kept as CONTRIBUTING.md asks."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
MOST_LINES = 15
MOST_LINES_OF_A_FUNCTION = 5


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    content = json.loads(path.read_text(encoding="utf-8"))
    return [cell for cell in content["cells"] if cell["cell_type"] == kind]


def sources(path: Path, kind: str = "code") -> list[str]:
    return ["".join(cell["source"]) for cell in cells(path, kind)]


named = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def test_there_are_notebooks_and_the_index_links_them_all() -> None:
    index = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) >= 4
    assert [path.name for path in NOTEBOOKS if f"]({path.name})" not in index] == []


@named
def test_notebook_is_kept_without_outputs_and_without_a_kernel(path: Path) -> None:
    assert json.loads(path.read_text(encoding="utf-8"))["metadata"] == {}
    for cell in cells(path, "code"):
        assert cell["outputs"] == []
        assert cell["execution_count"] is None


def test_nbstripout_finds_nothing_to_strip() -> None:
    command = [sys.executable, "-m", "nbstripout", "--verify", *map(str, NOTEBOOKS)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


@named
def test_notebook_begins_with_what_it_shows_and_ends_with_an_assert(path: Path) -> None:
    assert sources(path, "markdown")[0].startswith("# ")
    statements = ast.parse(sources(path)[-1]).body
    assert isinstance(statements[-1], ast.Assert)


@named
def test_logic_stays_in_the_package(path: Path) -> None:
    for source in sources(path):
        assert len(source.splitlines()) <= MOST_LINES
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.FunctionDef):
                assert node.end_lineno is not None
                assert node.end_lineno - node.lineno < MOST_LINES_OF_A_FUNCTION


@pytest.mark.slow
@named
def test_notebook_runs_without_a_display_and_its_claims_hold(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("MPLBACKEND", "agg")
    notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    resources = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=240, kernel_name="python3", resources=resources).execute()
    shown = [out for cell in notebook.cells if cell.cell_type == "code" for out in cell.outputs]
    complaints = [out.text for out in shown if out.get("name") == "stderr"]
    assert [text for text in complaints if not text.startswith("compiling: ")] == []
    pictures = {"<Figure": "image/png", "<Viewer": "text/html"}
    for out in shown:
        text = out.get("data", {}).get("text/plain", "")
        wanted = [kind for start, kind in pictures.items() if text.startswith(start)]
        assert set(wanted) <= set(out.get("data", {}))
