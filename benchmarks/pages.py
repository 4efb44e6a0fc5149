"""What the scripts share to write their pages: where the documentation is, tables in Markdown, figures as JSON."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
FIGURES = DOCS / "figures"


def parser(description: str | None, jobs: int | None = None) -> argparse.ArgumentParser:
    """Return the parser of a program that writes figures and rewrites pages.

    Args:
        description: Its first line describes the program.
        jobs: Processes where `--jobs` gives no other number; None for a program without them.
    """
    made = argparse.ArgumentParser(description=(description or "").splitlines()[0])
    made.add_argument("--out", type=Path, default=FIGURES, help="folder of the figures")
    made.add_argument("--docs", type=Path, default=DOCS, help="folder of the pages")
    if jobs is not None:
        made.add_argument("--jobs", type=int, default=jobs, help="processes")
    return made


def rewrite(page: Path, tables: Mapping[str, str]) -> None:
    """Put tables into a page, between <!-- name --> and <!-- end of name -->."""
    text = page.read_text("utf-8")
    for name, table in tables.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        if begin not in text:
            raise SystemExit(f"{page.name} has no place for the table '{name}'")
        before, rest = text.split(begin, 1)
        text = f"{before}{begin}\n{table}\n\n{end}{rest.split(end, 1)[1]}"
    page.write_text(text, encoding="utf-8")


def markdown(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A Markdown table; the first column to the left, the others to the right."""
    lines = [header, ["---", *["--:"] * (len(header) - 1)], *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def power(value: float | None) -> str:
    """A small figure."""
    return "–" if value is None or not np.isfinite(value) else f"{value:.1e}"


def plain(value: Any) -> Any:
    """Turn NumPy's numbers into JSON's with six digits; keys with a leading underscore are left out."""
    if isinstance(value, Mapping):
        return {str(k): plain(item) for k, item in value.items() if not str(k).startswith("_")}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return float(f"{value:.6g}") if isinstance(value, float) else value


def tell(figures: Any, out: Path | None) -> None:
    """Print figures as JSON, and write them to a file where there is one."""
    text = json.dumps(figures, indent=2).replace("NaN", "null")
    print(text)
    if out is not None:
        out.write_text(text + "\n", encoding="utf-8")
