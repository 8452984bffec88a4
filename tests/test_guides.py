"""The guides' code runs as it stands, from top to bottom, and prints what they say it prints."""

from __future__ import annotations

import ast
import re
import runpy
from itertools import pairwise
from pathlib import Path
from types import CodeType

import pytest

ROOT = Path(__file__).parents[1]
GUIDES = ("your-own-env", "learning-from-data")


def blocks_of(guide: str) -> list[tuple[str, str]]:
    text = (ROOT / "docs" / "guides" / f"{guide}.md").read_text(encoding="utf-8")
    return re.findall(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def snippets_of(guide: str) -> list[tuple[str, str]]:
    return [(code, text) for (kind, code), (_, text) in pairwise(blocks_of(guide)) if kind == "python"]


SNIPPETS = [(guide, number) for guide in GUIDES for number in range(len(snippets_of(guide)))]
SCRIPTS = [
    (line.split()[1:], text)
    for guide in GUIDES
    for (kind, line), (_, text) in pairwise(blocks_of(guide))
    if kind == "bash"
]


def defined_in(code: str) -> CodeType:
    """The imports and definitions among it."""
    kept = [part for part in ast.parse(code).body if isinstance(part, _DEFINITIONS)]
    return compile(ast.Module(kept, []), "the guide", "exec")


_DEFINITIONS = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.ClassDef)


def assert_shown(text: str, printed: str) -> None:
    """All of it, but for what a line with an ellipsis stands for."""
    parts = re.split(r"^…\n", text, flags=re.MULTILINE)
    assert all(part.strip() for part in parts[1:-1])
    pattern = ".*?".join(re.escape(part) for part in parts)
    assert re.fullmatch(pattern, printed, re.DOTALL), f"the guide shows\n{text}\nand this came:\n{printed}"


@pytest.mark.parametrize("guide", GUIDES)
def test_every_output_has_code_that_printed_it(guide: str) -> None:
    kinds = [kind for kind, _ in blocks_of(guide)]
    assert {"python", "text"} <= set(kinds) <= {"python", "bash", "text"}
    for kind, following in zip(kinds, [*kinds[1:], ""], strict=True):
        assert (kind == "text") != (following == "text")


def test_what_is_left_out_and_what_is_not() -> None:
    assert_shown("a\n…\nc\n", "a\nb\nc\n")
    assert_shown("…\nb\n…\n", "a\nb\nc\n")
    for text in ("a\nc\n", "b\n…\n", "…\nb\n", "a\n…\nb\n"):
        with pytest.raises(AssertionError):
            assert_shown(text, "a\nb\nc\n")


# Minari wants more said of a data set than a guide does.
@pytest.mark.filterwarnings("ignore::UserWarning:minari")
@pytest.mark.parametrize(("guide", "number"), SNIPPETS)
def test_the_code_of_the_guide(
    guide: str,
    number: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With what the code above it has imported and defined."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    snippets = snippets_of(guide)
    for extra in ("minari", "pettingzoo"):
        if extra in snippets[number][0]:
            pytest.importorskip(extra)
    names: dict[str, object] = {"__name__": "__main__"}
    for code, _ in snippets[:number]:
        exec(defined_in(code), names)
    code, text = snippets[number]
    exec(code, names)
    assert_shown(text, capsys.readouterr().out)


@pytest.mark.parametrize(("script", "text"), SCRIPTS, ids=[script[0] for script, _ in SCRIPTS])
def test_the_examples_of_the_guide(
    script: list[str], text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", script)
    runpy.run_path(str(ROOT / script[0]), run_name="__main__")
    assert_shown(text, capsys.readouterr().out)
