"""Runs the code on the pages (README.md and docs/) from top to bottom, and compares what it prints with what they show.

A page's fenced ``python`` code shares one namespace, its commands one folder, which is empty at first. The ``text``
after one of them is what it prints; a line ``…`` in it stands for what is left out. In ``console`` fences the output
follows each command, ``$ relgym …``. ``<!-- not run: why -->`` above a fence leaves it out.

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
GENERATED = ("docs/results.md", "docs/results/")
"""Pages that programs write, from measurements of hours."""

_FENCED = re.compile(
    r"^(?P<why><!-- not run: .+ -->\n)?```(?P<kind>\w*)\n(?P<body>.*?)^```$", re.DOTALL | re.MULTILINE
)
_TYPED = re.compile(r"^\$ (?P<command>.*)\n(?P<shown>(?:(?!\$ ).*\n)*)", re.MULTILINE)
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
    return [path for path in found if not path.relative_to(ROOT).as_posix().startswith(GENERATED)]


def snippets(page: str) -> Iterator[Snippet]:
    """What is to be run of a page's text, in order."""
    found = list(_FENCED.finditer(page))
    for fence, after in zip(found, [*found[1:], None], strict=False):
        line, start = page.count("\n", 0, fence.start("body")) + 1, fence.start("body")
        if fence["why"]:
            continue
        if fence["kind"] == "console":
            for typed in _TYPED.finditer(fence["body"]):
                span = (start + typed.start("shown"), start + typed.end("shown"))
                yield Snippet("console", typed["command"], typed["shown"] or None, span, line)
        elif fence["kind"] in ("python", "sh", "bash"):
            shown, span = None, (0, 0)
            if after is not None and after["kind"] == "text":
                shown, span = after["body"], after.span("body")
            yield Snippet("python" if fence["kind"] == "python" else "sh", fence["body"], shown, span, line)


def run(snippet: Snippet, names: dict[str, object], folder: Path) -> str:
    """What it prints.

    Raises
    ------
    AssertionError
        A command failed, or isn't one that a page may show.
    """
    if snippet.kind == "console":
        # Pages show mistakes, too: relgym ends with 2 there.
        return _command(snippet.code, folder, ends=(0, 2), stderr=subprocess.STDOUT)
    if snippet.kind == "sh":
        return "".join(_command(line, folder) for line in _lines(snippet.code))
    os.environ["MINARI_DATASETS_PATH"] = str(folder / "minari")  # not among the reader\'s own data sets
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        # Lines of the page, for tracebacks.
        exec(compile("\n" * (snippet.line - 1) + snippet.code, "the page", "exec"), names)
    return printed.getvalue()


def _lines(commands: str) -> list[str]:
    plain = (line.partition("  #")[0].strip() for line in commands.replace("\\\n", " ").splitlines())
    return [line for line in plain if line and not line.startswith("#")]


def _command(line: str, folder: Path, ends: tuple[int, ...] = (0,), stderr: int = subprocess.PIPE) -> str:
    """Run relgym and scripts; of what would install or take hours, see that it exists."""
    program, *arguments = shlex.split(line)
    if program == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        assert set(arguments) <= set(targets), f"the Makefile has no target for: {line}"
        return ""
    if program == "pip":
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
        env=os.environ | {"COLUMNS": "100", "PYTHONIOENCODING": "utf-8"},
        stdout=subprocess.PIPE,
        stderr=stderr,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode in ends, f"{line}\nended with {done.returncode}\n{done.stdout}\n{done.stderr}"
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
