"""The commands of the guide to the console, typed in an empty folder, print what it says they print."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from relgym.cli import app

GUIDE = (Path(__file__).parents[1] / "docs" / "guides" / "console.md").read_text(encoding="utf-8")
FENCES = re.findall(r"^```(console|sh)\n(.*?)^```$", GUIDE, re.DOTALL | re.MULTILINE)
SHOWN = re.compile(r"^\$ relgym (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
BARE = re.compile(r"^relgym (.*?)(?:\s+#.*)?(\n)", re.MULTILINE)
TYPED = [typed for kind, text in FENCES for typed in (SHOWN if kind == "console" else BARE).findall(text)]


def test_commands_are_there() -> None:
    assert len(TYPED) >= 8


def test_the_commands_of_the_guide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    for command, shown in TYPED:
        done = CliRunner().invoke(app, shlex.split(command), prog_name="relgym")
        assert done.exit_code in (0, 2), done.output
        if shown == "\n":
            assert done.exit_code == 0 and done.stdout
            continue
        assert shown.endswith("\n") and shown.strip("…\n"), "every command has an output"
        parts = re.split(r"^…\n", shown, flags=re.MULTILINE)
        pattern = ".*?".join(map(re.escape, parts))
        assert re.fullmatch(pattern, done.output, re.DOTALL), (
            f"relgym {command}\nshould print\n{shown}\n{done.output}"
        )
