"""Every command that a page shows runs, and says what the page says that it does."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from ..command_line import call

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "notebooks/README.md")),
    *(path for path in sorted(DOCS.rglob("*.md")) if "gallery" not in path.parts),
    *sorted((ROOT / "notebooks").glob("*.ipynb")),
]

FIGURES = r"\|e1\| at the end \[rad\] +│ +[\d.]+e-0[5-9]"
"""The first joint's error at the end of a run, below 1e-4 rad."""


@dataclass(frozen=True)
class Shown:
    """What a command of a page has to say.

    Attributes:
        says: Regular expressions that its output matches.
        files: Files that it writes.
        shorter: Options that make it fit for a test.
        needs: Commands that come before it.
        slow: Whether it takes seconds.
    """

    says: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    shorter: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    slow: bool = False


_TUNE = "tune ur5 --payload 2 --inertia-scale 1.1 --out out"
_RUN = "run ur5 --payload 1.3 --gains out/gains.json"
_PANDA = "run panda --lock panda_finger_joint1 --payload 2 --armature 0.1"
_RUN_FILES = ("errors.png", "impedance_error.png", "torque.png", "result.npz")
_TOOL = "ur5 --frame tool0 --payload 2 --inertia-scale 1.1 --armature 0.1"
_TUNE_TOOL = f"tune {_TOOL} --line 0,0.1,0.05 --period 2 --out out"
_TUNED = ("proposed gains", r"The controller's model holds [\d.]+ kg")
_STUDY = ("--robots", "ur5", "--samples", "1", "--disturbances", "nothing")

COMMANDS = {
    "robots": Shown((r"panda +│ +8 │ fixed │ example-robot-data",)),
    "inspect ur5": Shown((r"ur5: nq = 6, nv = 6, tool frame 'ee_link'", r"elbow_joint .* 150 ")),
    "inspect my_arm.urdf": Shown((r"my_arm: nq = 2, nv = 2", r"elbow +│ +-2 │ +2 │")),
    "inspect my_arm.urdf.xacro --xacro-arg payload:=4": Shown((r"my_arm: nq = 1", r"lift .* 4 │$")),
    "view ur5 --html ur5.html": Shown((r"^written: ur5\.html$",), ("ur5.html",)),
    "view panda": Shown((r"http://127\.0\.0\.1:\d+\S* shows it, until Ctrl-C",)),
    "view panda --html panda.html": Shown((r"^written: panda\.html$",), ("panda.html",)),
    "view out/result.npz --html run.html": Shown(
        (r"^written: run\.html$",), ("run.html",), needs=(f"{_RUN} --out out",), slow=True
    ),
    "paper": Shown(
        ("both corrected", "Slotine-Li", "inertia model, power surface, explicit scheme"),
        ("out/fig2_errors.png", "out/fig3_impedance_error.pdf", "out/fig4_torque.png"),
        shorter=("--duration", "1"),
        slow=True,
    ),
    "paper --out out": Shown(
        ("computed torque",),
        ("out/corrections.png", "out/baselines.pdf", "out/paper.npz"),
        ("--duration", "1"),
        slow=True,
    ),
    f"{_PANDA} --html out/run.html": Shown(
        ("no gains given: tuning panda", FIGURES), ("out/run.html",), slow=True
    ),
    f"{_PANDA} --duration 5 --out out/": Shown(
        ("no gains given: tuning panda", FIGURES),
        tuple(f"out/{name}" for name in _RUN_FILES),
        slow=True,
    ),
    "run panda --lock panda_finger_joint1,panda_finger_joint2 --payload 2 --armature 0.1 "
    "--stiffness 200 --wrench 0,20,0 --html run.html": Shown(
        ("tuned gains", FIGURES), ("run.html",), slow=True
    ),
    _TUNE: Shown(_TUNED, ("out/gains.json", "out/worst_samples.png"), slow=True),
    f"{_TUNE}/": Shown(_TUNED, ("out/gains.json", "out/worst_samples.png"), slow=True),
    "tune ur5 --payload 2": Shown(_TUNED, ("out/gains.json",), slow=True),
    _RUN: Shown((r"gains of out/gains\.json", FIGURES), needs=(_TUNE,), slow=True),
    f"{_RUN} --out out": Shown(
        (r"gains of out/gains\.json", FIGURES), ("out/result.npz",), needs=(_TUNE,), slow=True
    ),
    _TUNE_TOOL: Shown(
        ("frame 'tool0'", "proposed gains", "translation"), ("out/gains.json",), slow=True
    ),
    "run ur5 --frame tool0 --stiffness 1000,1000,200,30,30,30 --wrench 3,0,-10 --armature 0.1": Shown(
        ("no gains given: tuning ur5", "ok: within its limits"), ("out/path.png",), slow=True
    ),
    f"run {_TOOL} --circle 0.1 --gains out/gains.json": Shown(
        (r"ok: within its limits; its rms error is [\d.]+e-\d+ m and [\d.]+e-\d+ rad at the tool",),
        needs=(_TUNE_TOOL,),
        slow=True,
    ),
    "bench": Shown(("pin.rnea",), slow=True),
    "bench ur5 --json": Shown(('"ur5"',), slow=True),
    "study standard": Shown(
        ("medians of the runs", "written: standard/"), shorter=_STUDY, slow=True
    ),
    "study standard --jobs 2 --out out/standard": Shown(
        ("medians of the runs",), ("out/standard/summary.json",), _STUDY, slow=True
    ),
    "study linear --jobs 2 --out out/linear": Shown(
        ("medians of the runs",), ("out/linear/summary.json",), _STUDY, slow=True
    ),
    "connect sim panda --payload 1 --lost 0.1": Shown(
        ("simulated panda, 1000 Hz", "RunReport: finished", r"written: .*connect\.npz"),
        shorter=("--duration", "1"),
        slow=True,
    ),
    "connect sim two_link --payload 0.3 --lost 0.1 --duration 5": Shown(
        ("simulated two_link, 1000 Hz", "RunReport: finished"),
        shorter=("--duration", "1"),
        slow=True,
    ),
}
"""Every command of the pages, as it stands there, and what it says."""

NOT_RUN = {
    "connect franka fr3.urdf --host 172.16.0.2 --effort 0.2 --duration 10": "it needs a robot",
    "study mine.py:STUDY --jobs 2 --out out/mine": "its file is code of the page, which is tested with it",
}


_WORDS_OF_A_SENTENCE = [["run"], ["tune"], ["inspect"], ["view"], ["study"]]


def commands_of(path: Path) -> Iterator[str]:
    """The commands of a page in blocks of code and within its text, without those that leave something open."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        lines = [line for cell in cells for line in "".join(cell["source"]).splitlines()]
        text = "\n".join(re.sub(r"^[!%]\s*(sh )?", "    ", line) for line in lines)
    blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    indented = re.findall(r"^    (rbimpedance .*)$", text, flags=re.MULTILINE)
    within = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.M))
    for line in re.split(r"\n|&&|;| > ", "\n".join([*blocks, *indented, *within])):
        words = shlex.split(line, comments=True) if "rbimpedance " in line else []
        if words[:1] == ["rbimpedance"] and not words[1].startswith("-"):
            yield " ".join(words[1:])


def _leaves_something_open(command: str) -> bool:
    """Whether it is a form to fill in, as `run ROBOT`, or one word in a sentence on a command."""
    words = command.split()
    return words in _WORDS_OF_A_SENTENCE or any(
        re.search(r"^[A-Z]+$|\.\.\.|<", word) for word in words
    )


SHOWN = sorted(
    {
        command
        for path in PAGES
        for command in commands_of(path)
        if not _leaves_something_open(command)
    }
)


def test_what_every_command_of_the_pages_says_is_known() -> None:
    assert [command for command in SHOWN if command not in {*COMMANDS, *NOT_RUN}] == []


def test_every_command_that_is_known_stands_on_a_page() -> None:
    on_pages = {command for path in PAGES for command in commands_of(path)}
    assert sorted({*COMMANDS, *NOT_RUN} - on_pages) == []


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with the robots of the page on one's own URDF."""
    text = (DOCS / "how-to" / "own-urdf.md").read_text(encoding="utf-8")
    urdf, xacro = re.findall(r'"""\n(<robot.*?)"""', text, flags=re.DOTALL)
    (tmp_path / "my_arm.urdf").write_text(urdf, encoding="utf-8")
    (tmp_path / "my_arm.urdf.xacro").write_text(xacro, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, marks=[pytest.mark.slow] if shown.slow else [])
        for command, shown in COMMANDS.items()
    ],
)
def test_command_of_a_page_runs_and_says_what_it_is_for(
    command: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("rbimpedance.cli.view.Event", _Interrupted)
    said = _say(command, monkeypatch, capsys)
    for words in COMMANDS[command].says:
        assert re.search(words, said, flags=re.MULTILINE), words
    for name in COMMANDS[command].files:
        assert (folder / name).stat().st_size > 0


def _say(command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command after what it needs; returns what it alone wrote."""
    for before in COMMANDS[command].needs:
        _say(before, monkeypatch, capsys)
    capsys.readouterr()
    assert call(monkeypatch, *command.split(), *COMMANDS[command].shorter) == 0
    said = capsys.readouterr()
    assert "failed" not in said.err
    return said.out


class _Interrupted:
    """Ctrl-C, as soon as the page is served."""

    def wait(self) -> None:
        raise KeyboardInterrupt
