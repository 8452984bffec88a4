"""Runs the code on the pages (README.md and docs/) from top to bottom, and compares what it prints with what they show.

A page's fenced ``python`` code shares one namespace, its commands one folder, which is empty at first. The
``text`` after one of them is what it prints; a line ``…`` in it stands for what is left out. ``<!-- not run: why -->``
above a fence leaves it out.

Run as a script (`make pages`) it writes what is printed now into the pages.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LEFT_OUT = ("docs/results.md", "docs/results/", "docs/guides/console.md")
"""Pages that programs write, from measurements of hours; and the guide to the console, whose commands print in between
(`tests/test_console_guide.py`)."""

_FENCED = re.compile(
    r"^(?P<why><!-- not run: .+ -->\n)?```(?P<kind>\w*)\n(?P<body>.*?)^```$", re.DOTALL | re.MULTILINE
)
_SHELL = ("bash", "console", "sh")
_ELLIPSIS = re.compile(r"^…\n", re.MULTILINE)


@dataclass(frozen=True)
class Snippet:
    """Code, or commands, and the text that it should print: ``None`` where the page shows none."""

    kind: str
    code: str
    shown: str | None
    span: tuple[int, int]
    """Where the shown text begins and ends in the page."""
    line: int


def pages() -> list[Path]:
    """All pages that people wrote."""
    found = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [path for path in found if not path.relative_to(ROOT).as_posix().startswith(LEFT_OUT)]


def snippets(page: str) -> Iterator[Snippet]:
    """What is to be run of a page's text, in order."""
    found = list(_FENCED.finditer(page))
    for fence, after in zip(found, [*found[1:], None], strict=False):
        if fence["kind"] not in ("python", *_SHELL) or fence["why"]:
            continue
        prints = after is not None and after["kind"] == "text"
        yield Snippet(
            "python" if fence["kind"] == "python" else "commands",
            fence["body"],
            after["body"] if after is not None and prints else None,
            after.span("body") if after is not None and prints else (0, 0),
            page.count("\n", 0, fence.start("body")) + 1,
        )


def run(snippet: Snippet, names: dict[str, object], folder: Path) -> str:
    """What it prints.

    Raises
    ------
    AssertionError
        A command failed, or isn't one that a page may show.
    """
    if snippet.kind == "commands":
        return "".join(_command(line.removeprefix("$ "), folder) for line in _lines(snippet.code))
    os.environ["MINARI_DATASETS_PATH"] = str(folder / "minari")  # not among the reader's own data sets
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        # Lines of the page, for tracebacks.
        exec(compile("\n" * (snippet.line - 1) + snippet.code, "the page", "exec"), names)
    return printed.getvalue()


def _lines(commands: str) -> list[str]:
    plain = (line.partition("  #")[0].strip() for line in commands.replace("\\\n", " ").splitlines())
    return [line for line in plain if line and not line.startswith("#")]


def _command(line: str, folder: Path) -> str:
    """Run relgym and scripts; of what would install or take hours, see that it exists."""
    program, *arguments = shlex.split(line)
    if program == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        assert set(arguments) <= set(targets), f"the Makefile has no target for: {line}"
        return ""
    if program in ("pip", "export", "git", "cd"):
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        extras = {name for part in re.findall(r"\[(.+?)\]", line) for name in part.split(",")}
        assert extras <= set(project["optional-dependencies"]), f"pyproject.toml has no such extra: {line}"
        return ""
    assert program in ("python", "relgym"), f"what is to be done with this command? {line}"
    if program == "python" and arguments[0] != "-m":
        arguments[0] = str(ROOT / arguments[0])
    start = ["-c", "from relgym.cli import app; app(prog_name='relgym')"] if program == "relgym" else []
    done = subprocess.run(
        [sys.executable, *start, *arguments],
        cwd=folder,
        env=os.environ | {"COLUMNS": "120", "PYTHONIOENCODING": "utf-8"},
        capture_output=True,
        text=True,
        encoding="utf-8",
    )
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def agrees(shown: str, printed: str) -> bool:
    """Whether this is what was printed, but for what ellipses stand for."""
    pattern = ".*?".join(re.escape(part) for part in _ELLIPSIS.split(shown))
    return re.fullmatch(pattern, printed, re.DOTALL) is not None


def renewed(shown: str, printed: str) -> str:
    """The printed text, with what the shown one leaves out left out.

    Between ellipses a part begins and ends with the printed lines that are most like its first and last ones.
    """
    parts = [part.splitlines() for part in _ELLIPSIS.split(shown)]
    if len(parts) == 1:
        return printed
    lines, at, kept = printed.splitlines(), 0, []
    for number, part in enumerate(parts):
        if not part:
            kept.append("")
            continue
        first = at if number == 0 else _most_like(part[0], lines, at, at)
        last = (
            len(lines) - 1
            if number == len(parts) - 1
            else _most_like(part[-1], lines, first, first + len(part) - 1)
        )
        kept.append("".join(f"{line}\n" for line in lines[first : last + 1]))
        at = last + 1
    return "…\n".join(kept)


def _most_like(wanted: str, lines: list[str], start: int, expected: int) -> int:
    """Index of the line most like this one, from `start` on; among equals the one nearest to where it is expected."""

    def likeness(i: int) -> tuple[float, int]:
        return SequenceMatcher(None, wanted, lines[i], autojunk=False).ratio(), -abs(i - expected)

    return max(range(start, len(lines)), key=likeness)


def renew(path: Path) -> int:
    """Write what a page's code prints into the page; how many of its texts were others before."""
    page = path.read_text(encoding="utf-8")
    names: dict[str, object] = {"__name__": "__main__"}
    changed: list[tuple[tuple[int, int], str]] = []
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for snippet in snippets(page):
            printed = run(snippet, names, Path(folder))
            if snippet.shown is not None and not agrees(snippet.shown, printed):
                changed.append((snippet.span, renewed(snippet.shown, printed)))
    for (start, end), text in reversed(changed):
        page = page[:start] + text + page[end:]
    path.write_text(page, encoding="utf-8")
    return len(changed)


def main() -> None:
    """Renew the pages named on the command line, or else all that show what is printed."""
    for path in [Path(name).resolve() for name in sys.argv[1:]] or pages():
        if any(snippet.shown is not None for snippet in snippets(path.read_text(encoding="utf-8"))):
            print(f"{path.relative_to(ROOT)}: {renew(path)} changed", flush=True)


if __name__ == "__main__":
    main()
