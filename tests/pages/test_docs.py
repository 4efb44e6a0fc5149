"""The documentation holds: recipes run, commands parse, links lead somewhere, every public name is described."""

from __future__ import annotations

import inspect
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import matplotlib as mpl
import pytest
from typer.main import get_command

import rbimpedance as rbi
from rbimpedance.cli import app as cli
from rbimpedance.pictures import figures as plotting

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [path for path in sorted(DOCS.rglob("*.md")) if "gallery" not in path.parts]
RECIPES = [path for path in PAGES if path.parent.name == "how-to" and path.stem != "index"]
PUBLIC = {name: getattr(rbi, name) for name in dir(rbi)}


def blocks(path: Path, language: str) -> list[str]:
    """The fenced code blocks of a page."""
    text = path.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)


# --- recipes ----------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("path", [*RECIPES, DOCS / "start.md"], ids=lambda path: path.stem)
def test_every_line_of_a_recipe_runs(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for extra in re.findall(r"rbimpedance\[(\w+)\]", path.read_text(encoding="utf-8")):
        pytest.importorskip(extra)  # named as what it brings
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": path.stem}
    with mpl.rc_context():
        for block in blocks(path, "python"):
            exec(compile(block, str(path), "exec"), names)
    assert names["rbi"] is rbi


def test_index_of_the_recipes_names_them_all() -> None:
    index = (DOCS / "how-to" / "index.md").read_text(encoding="utf-8")
    assert RECIPES
    assert [path.name for path in RECIPES if f"]({path.name})" not in index] == []


def calls(text: str) -> Iterator[list[str]]:
    """The words after `rbimpedance` of every call of it in a text."""
    for line in re.split(r"\n|&&|;", text):
        words = shlex.split(line, comments=True) if "rbimpedance " in line else []
        if words[:1] == ["rbimpedance"] and not words[1].startswith("-"):
            yield words[1:]


@pytest.mark.parametrize("path", [*PAGES, ROOT / "README.md"], ids=lambda path: path.stem)
def test_every_command_of_a_page_is_one_that_the_command_line_takes(path: Path) -> None:
    group: Any = get_command(cli.app)
    for name, *arguments in calls("\n".join(blocks(path, "sh"))):
        assert group.commands[name].make_context(name, arguments)
    for name, *arguments in calls("\n".join(re.findall(r"`([^`\n]+)`", path.read_text("utf-8")))):
        known = {option for parameter in group.commands[name].params for option in parameter.opts}
        assert {word for word in arguments if word.startswith("--")} <= known | {"--help"}


# --- pages ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(DOCS).as_posix())
def test_every_link_of_a_page_leads_somewhere(path: Path) -> None:
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = re.findall(r"\]\((?!https?://|#)([^)#\s]+)", text)
    drawn = re.compile(r"gallery/\w+\.png")  # by benchmarks/pictures/gallery.py
    missing = [t for t in targets if not drawn.fullmatch(t) and not (path.parent / t).exists()]
    assert missing == []


def test_every_page_is_in_a_table_of_contents() -> None:
    for folder in {path.parent for path in PAGES}:
        index = folder / "index.md"
        listed = "\n".join(re.findall(r"```\{toctree\}\n(.*?)```", index.read_text("utf-8"), re.S))
        pages = {path.stem for path in PAGES if path.parent == folder} - {"index"}
        assert sorted(pages - set(listed.split())) == []


def test_gallery_and_its_script_show_every_figure_that_there_is() -> None:
    script = (ROOT / "benchmarks" / "pictures" / "gallery.py").read_text(encoding="utf-8")
    page = (DOCS / "gallery.md").read_text(encoding="utf-8")
    figures = {name for name, value in vars(plotting).items() if inspect.isfunction(value)} - {
        "save"
    }
    assert set(re.findall(r'^        "(\w+)": plotting\.', script, flags=re.MULTILINE)) == figures
    assert set(re.findall(r"\(gallery/(\w+)\.png\)", page)) == figures


def test_pages_load_nothing_from_another_machine() -> None:
    for path in (*PAGES, DOCS / "conf.py", DOCS / "site.css"):
        text = path.read_text(encoding="utf-8")
        assert (
            re.findall(r"(?:!\[[^\]]*\]\(|src=[\"']?|url\([\"']?|@import )\s*https?:", text) == []
        )


# --- reference --------------------------------------------------------------------------------------------------

REFERENCE = {path.stem: path.read_text(encoding="utf-8") for path in (DOCS / "api").glob("*.md")}
DESCRIBED = re.findall(r"automodule:: (rbimpedance[\w.]+)", "\n".join(REFERENCE.values()))


def test_index_of_the_reference_lists_every_public_name() -> None:
    listed = set(re.findall(r"`(\w+)`", REFERENCE["index"]))
    assert sorted(set(PUBLIC) - listed) == []


def test_index_of_the_reference_lists_public_names_only() -> None:
    rows = re.findall(
        r"^\| \[.*?\]\(.*?\) \| ([^;\n]*?)(?:; in .*?)? \|$", REFERENCE["index"], re.M
    )
    listed = set(re.findall(r"`(\w+)`", " ".join(rows)))
    assert sorted(listed - set(PUBLIC)) == []


def test_every_public_name_is_described_where_its_module_is() -> None:
    defined_in = {getattr(value, "__module__", "") for value in PUBLIC.values()}
    defined_in = {name for name in defined_in if name.startswith("rbimpedance.")}
    assert len(defined_in) > 20
    assert sorted(defined_in - set(DESCRIBED)) == []


def test_every_module_that_the_pages_import_is_described() -> None:
    code = "\n".join("\n".join(blocks(path, "python")) for path in PAGES)
    imported = set(re.findall(r"^from (rbimpedance\.[\w.]+) import", code, flags=re.MULTILINE))
    imported |= {
        getattr(getattr(rbi, name), "__name__", f"rbimpedance.{name}")
        for names in re.findall(r"^from rbimpedance import (.+)", code, flags=re.MULTILINE)
        for name in names.split(", ")
    }
    packages = {module.rpartition(".")[0] for module in DESCRIBED}
    assert sorted(imported - set(DESCRIBED) - packages) == []


def test_every_described_module_is_there_once_and_says_what_it_holds() -> None:
    assert len(set(DESCRIBED)) == len(DESCRIBED)
    for name in DESCRIBED:
        module = __import__(name, fromlist=["_"])
        assert isinstance(module, ModuleType)
        assert module.__doc__
