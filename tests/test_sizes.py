"""No module, class, function or signature grows beyond what fits in a head; ruff holds complexity and signatures."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

import rbimpedance

SOURCES = Path(rbimpedance.__file__).parent

LARGEST = {"module": 300, "class": 250, "function": 40}
"""Lines of code, without docstrings, comments and blank lines."""

EXCEPTIONS: dict[str, str] = {}
"""What may be larger, and the reason."""

_SILENT = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE),
    *(tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER),
}


def _code_lines(text: str, tree: ast.Module) -> set[int]:
    """Numbers of the lines that hold code."""
    docstrings = {
        line
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    code = {
        line
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type not in _SILENT
        for line in range(token.start[0], token.end[0] + 1)
    }
    return code - docstrings


def _sizes() -> Iterator[tuple[str, str, int]]:
    """Kind, name and size of everything."""
    for path in sorted(SOURCES.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        tree, name = ast.parse(text), str(path.relative_to(SOURCES))
        lines = _code_lines(text, tree)
        yield "module", name, len(lines)
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef | ast.FunctionDef):
                inside = range(node.lineno, (node.end_lineno or node.lineno) + 1)
                kind = "class" if isinstance(node, ast.ClassDef) else "function"
                yield kind, f"{name}:{node.name}", len(lines & set(inside))


@pytest.mark.slow
def test_nothing_is_larger_than_it_may_be() -> None:
    large = {name: size for kind, name, size in _sizes() if size > LARGEST[kind]}
    assert {name: size for name, size in large.items() if name not in EXCEPTIONS} == {}
    assert set(EXCEPTIONS) <= set(large), "an exception that is not needed any more"
