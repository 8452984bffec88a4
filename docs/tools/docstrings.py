"""Docstrings as Markdown: headings, tables, and `Name` as a link to where that public name is described."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from typing import Any

import griffe

sys.path.insert(0, str(Path(__file__).parent))
from facades import FACADES, public_names

_RULE = re.compile(r"^ *=+(?: +=+)+ *$")
_HEADING = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)
_KNOWN = (
    "Attributes",
    "Examples",
    "Notes",
    "Parameters",
    "Raises",
    "References",
    "Returns",
    "Warns",
    "Yields",
)
_NAME = re.compile(r"(?<![`\[\w])`([A-Za-z_][\w.]*)`(?![`\]])")


class PlainDocstrings(griffe.Extension):
    """Rewrites every docstring before it is parsed."""

    def on_module_members(self, *, mod: griffe.Module, **kwargs: Any) -> None:
        """Show griffe, which reads and doesn't run, the names that a façade loads on first use."""
        for table in ("_HOMES", "_LAZY_NAMES"):
            if table in mod.members and mod.path in FACADES:
                for name, home in ast.literal_eval(str(mod.members[table].value)).items():
                    if name not in mod.members:
                        mod.set_member(name, griffe.Alias(name, f"{home}.{name}", parent=mod))

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Convert headings and tables, and link names."""
        if obj.docstring:
            text = with_markdown_tables(with_markdown_headings(obj.docstring.value))
            obj.docstring.value = linked(text, obj.name)


def linked(text: str, own: str) -> str:
    """`Name` as a reference, where Name is public and not the object's own."""

    def link(match: re.Match[str]) -> str:
        name = match[1].rpartition(".")[2] if match[1].startswith("relgym.") else match[1]
        path = public_names().get(name)
        # Classes only, and none of the logic library: `learn` and `World` mean many things.
        return (
            match[0]
            if path is None or name == own or not name[0].isupper() or ".logic." in path
            else f"[`{match[1]}`][{path}]"
        )

    return _NAME.sub(link, text)


def with_markdown_headings(text: str) -> str:
    """Sections that numpydoc doesn't know, those of an env's data sheet, as headings; then those that it knows."""
    start, *parts = _HEADING.split(text)
    prose, known = [start], []
    for title, body in zip(parts[::2], parts[1::2], strict=True):
        name = "Parameters" if title == "Arguments" else title
        if name in _KNOWN:
            known.append(f"{name}\n{'-' * len(name)}{body}")
        else:
            prose.append(f"# {name}\n{body}")
    return "".join(part.rstrip() + "\n\n" for part in prose + known).rstrip()


def with_markdown_tables(text: str) -> str:
    """Simple tables of reStructuredText (rules of ``===``) as Markdown's."""
    lines, out = text.split("\n"), []
    while lines:
        if not _RULE.match(lines[0]):
            out.append(lines.pop(0))
            continue
        rule = lines.pop(0)
        # Its last rule is the one that a blank line follows; one before that ends the heading.
        end = next(
            i
            for i, line in enumerate(lines)
            if _RULE.match(line) and not "".join(lines[i + 1 : i + 2]).strip()
        )
        heading = next((i for i, line in enumerate(lines[:end]) if _RULE.match(line)), None)
        out += _table(
            rule,
            [] if heading is None else lines[:heading],
            lines[0 if heading is None else heading + 1 : end],
        )
        del lines[: end + 1]
    return "\n".join(out)


def _table(rule: str, heading: list[str], lines: list[str]) -> list[str]:
    starts = [m.start() for m in re.finditer("=+", rule)]
    spans = list(zip(starts, [*starts[1:], None], strict=True))
    rows: list[list[str]] = []
    for line in (*(heading or [""]), *lines):
        cells = [line[a:b].strip() for a, b in spans]
        if cells[0] or not rows or not any(rows[-1]):
            rows.append(cells)
        else:  # goes on where the row above left off
            rows[-1] = [f"{a} {b}".strip() for a, b in zip(rows[-1], cells, strict=True)]
    marked = [f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in rows]
    return ["", marked[0], "|" + " --- |" * len(spans), *marked[1:], ""]
