"""The help is grouped, with examples and units, and without internals."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from rodsight.cli.command_list import GROUPS, command_line, name_of, overview, purpose

from tests.program import rodsight

COMMANDS = [command for group in GROUPS.values() for command in group]
QUANTITIES = {  # options, and the unit in their help
    "--pixel-size": "m", "--interval": "s", "--idle": "s", "--max-size": "MB", "--density": "kg/m³", "--length": "m",
    "--step-degrees": "°", "--pressure": "Pa",
}  # fmt: skip


def printed_text(capsys: pytest.CaptureFixture, *arguments: str) -> str:
    assert rodsight(*arguments) == 0
    return " ".join(re.sub(r"[│╭╰╮╯─]", " ", capsys.readouterr().out).split())


@pytest.mark.parametrize("command", COMMANDS, ids=name_of)
def test_every_command_has_help_with_an_example_and_units(command, capsys):
    text = printed_text(capsys, name_of(command), "--help")
    assert f"Example: rodsight {name_of(command)} " in text
    assert "None" not in text
    assert "%%" not in text
    assert "default: )" not in text
    for option, unit in QUANTITIES.items():
        if meaning := re.search(rf"{option} (?!N?\s*\|)[^-]*?(?= --|$)", text.split("options", 1)[1]):
            assert f"[{unit}" in meaning[0], f"{option}: {meaning[0]}"


@pytest.mark.parametrize("command", COMMANDS, ids=name_of)
def test_a_command_is_annotated_once_however_often_arguments_are_parsed(command):
    command_line()
    before = dict(command.__annotations__)
    command_line()
    assert command.__annotations__ == before


def test_the_overview_lists_every_command_in_one_line(capsys):
    text = overview()
    for command in COMMANDS:
        assert f"  {name_of(command):<12} {purpose(command)}\n" in text
        assert len(purpose(command)) < 110
    assert "--completion" in text
    for arguments in ((), ("--help",), ("-h",)):
        assert rodsight(*arguments) == 0
        assert capsys.readouterr().out == text + "\n"


@pytest.mark.thorough
def test_completion_of_a_shell_is_printed(capsys):
    assert "bash completion" in printed_text(capsys, "--completion", "bash").lower()
    assert rodsight("--completion", "fish") == 2
    assert "is not one of bash, zsh, tcsh" in capsys.readouterr().err


def test_the_overview_loads_no_numerics():
    code = "import sys; from rodsight.cli.command_list import overview; overview(); print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.thorough
def test_a_run_reads_its_first_photograph_before_it_loads_the_libraries_of_the_stages(made_photographs, tmp_path):
    code = """
import sys
from rodsight.cli.main import main
from rodsight.experiment import photographs
def first(*arguments):
    print(sorted({"rodsight.pipeline", "numba", "scipy", "h5py", "cv2", "rerun", "pandas"} & sys.modules.keys()))
    sys.stdout.flush()
    __import__("os")._exit(0)
photographs.content_of = first
main()
"""
    command = [sys.executable, "-c", code, "run", made_photographs, "--out", tmp_path / "run", "--quiet"]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.slow
def test_the_workbench_starts_without_what_only_shows_recordings_or_exports():
    code = "import sys, rodsight.workbench.service.server, rodsight.workbench.command; print(sys.modules.keys() & {%s})"
    heavy = ", ".join(f"'{name}'" for name in ("rerun", "pandas", "matplotlib", "vtk"))
    done = subprocess.run([sys.executable, "-c", code % heavy], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
