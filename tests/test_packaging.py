"""What is built, and what works where it is installed: wheel, sdist and editable."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

import rbimpedance as rbi

ROOT = Path(__file__).parents[1]
LOAD_TWO_LINK = """
import pathlib, rbimpedance
print(pathlib.Path(rbimpedance.__file__).parent)
print(*rbimpedance.load_robot("two_link").joint_names)
"""


def _run(*arguments: str | Path, cwd: Path, **environment: str) -> str:
    run = subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


def _wheel(source: Path, folder: Path) -> Path:
    """Build with the backend of this environment: nothing is downloaded."""
    offline = ("--no-deps", "--no-build-isolation", "--no-index", "--wheel-dir")
    _run("-m", "pip", "wheel", "--quiet", *offline, folder, source, cwd=folder)
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _wheel(ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def sdist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sdist")
    _run("-m", "hatchling", "build", "--target", "sdist", "--directory", folder, cwd=ROOT)
    (sdist,) = folder.glob("*.tar.gz")
    return sdist


def _names(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


@pytest.mark.slow
def test_wheel_carries_every_module_and_every_bundled_robot(wheel: Path) -> None:
    package, robots = ROOT / "src" / "rbimpedance", ROOT / "urdf"
    modules = [p.relative_to(package.parent).as_posix() for p in package.rglob("*.py")]
    bundled = [f"rbimpedance/urdf/{p.relative_to(robots).as_posix()}" for p in robots.rglob("*.*")]
    assert bundled
    assert {*modules, *bundled, "rbimpedance/py.typed"} <= _names(wheel)


@pytest.mark.slow
def test_wheel_from_the_sdist_is_the_wheel_from_the_checkout(
    wheel: Path, sdist: Path, tmp_path: Path
) -> None:
    assert _names(_wheel(sdist, tmp_path)) == _names(wheel)


def test_sdist_carries_tests_and_documents(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    documents = {"README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md"}
    tests = {p.relative_to(ROOT).as_posix() for p in (ROOT / "tests").rglob("*.py")}
    assert documents | tests <= names


@pytest.mark.slow
def test_wheel_install_finds_its_robots_without_the_checkout(wheel: Path, tmp_path: Path) -> None:
    target, elsewhere = tmp_path / "target", tmp_path / "elsewhere"
    elsewhere.mkdir()
    offline = ("--no-deps", "--no-index", "--target", target)
    _run("-m", "pip", "install", "--quiet", *offline, wheel, cwd=elsewhere)
    output = _run("-c", LOAD_TWO_LINK, cwd=elsewhere, PYTHONPATH=str(target))
    assert output.splitlines() == [str(target / "rbimpedance"), "joint1 joint2"]


@pytest.mark.slow
def test_editable_install_finds_the_top_level_robots(tmp_path: Path) -> None:
    package = ROOT / "src" / "rbimpedance"
    if Path(rbi.__file__).parent != package:
        pytest.skip("needs the editable install: pip install -e .")
    assert not (package / "urdf").exists()
    output = _run("-c", LOAD_TWO_LINK, cwd=tmp_path)
    assert output.splitlines() == [str(package), "joint1 joint2"]


def test_command_line_is_installed(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith("entry_points.txt"))
        assert "rbimpedance = rbimpedance.cli:main" in archive.read(name).decode()


def test_version_is_said_alike_everywhere() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert rbi.__version__ == version("rbimpedance")
    assert f"\nversion: {rbi.__version__}\n" in citation


def test_pre_commit_and_ci_run_the_same_checks() -> None:
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    checks = lines[lines.index("ruff check") : lines.index("pytest") - 2]
    assert re.findall(r"entry: (.+)", hooks) == checks
