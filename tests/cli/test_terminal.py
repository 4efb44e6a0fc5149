"""What the command line shows: in a terminal and into a file, narrow and wide, with colours and without."""

from __future__ import annotations

import json
import os
import pty
import re
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from rbimpedance.cli import app as cli
from rbimpedance.cli import terminal as _terminal
from rbimpedance.cli.terminal import print_table, progress, table

from ..arms import LIMIT, urdf, urdf_joint, urdf_link
from ..command_line import call

COMMANDS: Any = get_command(cli.app)
START = Path(__file__).parents[2] / "docs" / "start.md"
COLOUR = re.compile(r"\x1b\[[0-9;]*(3[0-7]|9[0-7]|38;)[0-9;]*m")
GAINS = ("--k1", "15", "--k2", "40")
RUN = ("run", "two_link", *GAINS, "--duration", "0.02", "--out", "out")


def in_a_terminal(folder: Path, *arguments: str, columns: int = 80, **environment: str) -> str:
    """What a command writes to a terminal of some width."""
    ours, theirs = pty.openpty()
    leave_out = {"NO_COLOR", "FORCE_COLOR", "COLORTERM"}
    inherited = {key: value for key, value in os.environ.items() if key not in leave_out}
    settings = {"COLUMNS": str(columns), "LINES": "40", "TERM": "xterm-256color"}
    command = [sys.executable, "-m", "rbimpedance", *arguments]
    with subprocess.Popen(
        command,
        cwd=folder,
        env=inherited | settings | environment,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
    ) as process:
        os.close(theirs)
        said = b""
        while True:
            try:
                chunk = os.read(ours, 65536)
            except OSError:  # the other end is closed
                break
            if not chunk:
                break
            said += chunk
        assert process.wait(timeout=60.0) == 0
    os.close(ours)
    return said.decode()


def plain(text: str) -> str:
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)


# --- terminal and file ------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_terminal_shows_progress_with_the_time_left_and_colours(tmp_path: Path) -> None:
    said = in_a_terminal(tmp_path, *RUN)
    assert "simulating two_link" in said
    assert "0:00:00" in said
    assert COLOUR.search(said)


@pytest.mark.slow
def test_no_color_is_respected(tmp_path: Path) -> None:
    said = in_a_terminal(tmp_path, *RUN, NO_COLOR="1")
    assert "simulating two_link" in said
    assert COLOUR.search(said) is None


@pytest.mark.slow
def test_quiet_run_shows_neither_progress_nor_table_in_a_terminal(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for console in (_terminal.stdout, _terminal.stderr):
        monkeypatch.setattr(console, "_force_terminal", True)
    assert call(monkeypatch, *RUN, "--quiet") == 0
    said = capsys.readouterr()
    assert plain(said.out).startswith("written: ")
    assert "simulating" not in said.err


def test_progress_stays_out_of_files(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("simulating", quiet=False) as on_tick:
        on_tick(100, 200)
        on_tick(200, 200)
    assert capsys.readouterr() == ("", "")


# --- tables -----------------------------------------------------------------------------------------------------

NAMES = [f"a_joint_with_a_long_name_{i}" for i in range(3)]
HEADER = ("joint", *(f"quantity {i} [rad/s^2]" for i in range(8)))
FIGURES = [[f"{-1.23456 * 10**i + j:.3g}" for i in range(8)] for j in range(3)]


@pytest.mark.parametrize("columns", [60, 80, 100, 200])
def test_table_in_a_terminal_of_any_width_keeps_every_figure_beside_its_joint(
    columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(_terminal.stdout, "_force_terminal", True)
    monkeypatch.setattr(_terminal.stdout, "_width", columns)
    rows = [[name, *figures] for name, figures in zip(NAMES, FIGURES, strict=True)]
    print_table(table("bounds", HEADER, rows))
    lines = plain(capsys.readouterr().out).splitlines()
    assert max(map(len, lines)) <= columns
    for name, figures in zip(NAMES, FIGURES, strict=True):
        told = " ".join(line.split("│", 2)[2] for line in lines if name in line)
        assert told.replace("│", " ").split() == figures


def test_table_in_a_file_has_80_columns_and_every_figure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    header = ("joint", *(f"a long heading {i}" for i in range(40)))
    print_table(table("wide", header, [["one", *map(str, range(40))]]))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "wide"
    assert max(map(len, lines)) <= 80
    told = " ".join(line.split("│", 2)[2] for line in lines if line.startswith("│ one"))
    assert told.replace("│", " ").split() == [str(i) for i in range(40)]


# --- every command ----------------------------------------------------------------------------------------------


def test_first_page_of_the_docs_lists_every_command() -> None:
    listed = re.findall(r"^\| `rbimpedance (\w+)", START.read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(COMMANDS.commands)


@pytest.mark.parametrize("command", sorted(COMMANDS.commands))
def test_every_command_has_json_quiet_and_an_example(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert call(monkeypatch, command, "--help") == 0
    said = capsys.readouterr().out
    expected = {"--json"} if command == "bench" else {"--json", "--quiet"}  # bench is its table
    assert expected <= set(re.findall(r"--\w+", said))
    assert f"Example: rbimpedance {command}" in said


@pytest.mark.parametrize("command", sorted(COMMANDS.commands))
def test_help_fits_80_columns_without_breaking_a_word(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert call(monkeypatch, command, "--help") == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 80
    words = set(said.split())
    for parameter in COMMANDS.commands[command].params:
        if not getattr(parameter, "hidden", False):
            assert set(parameter.opts) <= words | {parameter.name}
            missing = [word for word in (parameter.help or "").split() if word not in words]
            assert missing == []


def test_help_loses_no_unit_to_markup() -> None:
    helps = [
        parameter.help or ""
        for command in COMMANDS.commands.values()
        for parameter in command.params
        if hasattr(parameter, "help")
    ]
    assert len(helps) > 40
    assert [text for text in helps if "[" in text] == []


def test_view_tells_its_file_as_json(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, "view", "two_link", "--html", "two_link.html", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said == {"file": "two_link.html", "notes": []}


# --- what goes wrong --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        ("view", "two_link", "--html", "file/two_link.html"),
        ("run", "two_link", *GAINS, "--duration", "0.01", "--quiet", "--out", "file"),
        ("run", "two_link", *GAINS, "--duration", "0.01", "--quiet", "--html", "file/run.html"),
    ],
)
def test_place_that_cannot_be_written_to_is_exit_code_2_and_named(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    assert call(monkeypatch, *arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("error: ")
    assert "'file" in said


def test_port_in_use_is_exit_code_2_and_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert call(monkeypatch, "view", "two_link", "--port", str(port)) == 2
    assert re.search(rf"port must be free .* got {port}", capsys.readouterr().err)


def test_missing_mesh_is_a_note_and_the_file_is_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    mesh = '<visual><geometry><mesh filename="package://my_arm/hand.stl"/></geometry></visual>'
    hand = urdf_link("hand", 1.0).replace("</link>", f"{mesh}</link>")
    joint = urdf_joint("turn", "revolute", "base", "hand", "0 1 0", LIMIT)
    (tmp_path / "arm.urdf").write_text(urdf(joint, hand), encoding="utf-8")
    assert call(monkeypatch, "view", "arm.urdf", "--html", "arm.html") == 0
    said = capsys.readouterr()
    assert "note: 1 mesh file cannot be shown ('package://my_arm/hand.stl'" in said.err
    assert said.out == "written: arm.html\n"


@pytest.mark.slow
def test_view_without_a_display_says_so_and_goes_on_serving(tmp_path: Path) -> None:
    """Neither a display nor a browser: the page is served all the same."""
    command = [sys.executable, "-u", "-m", "rbimpedance", "view", "two_link", "--open"]
    nothing = {"PATH": str(tmp_path), "HOME": str(tmp_path)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, env=nothing, text=True, **pipes) as process:  # type: ignore[call-overload]
        url = process.stdout.readline().split()[0]
        line = process.stderr.readline()
        line = process.stderr.readline() if line.startswith("loading") else line
        assert line == f"note: no browser with windows here; {url} shows the page\n"
        assert process.poll() is None
        with socket.create_connection(("127.0.0.1", int(url.split(":")[2].strip("/")))):
            process.terminate()
