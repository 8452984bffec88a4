"""What notebooks show of a model: small pieces of HTML without scripts or styles of their own, all text escaped."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

__all__ = ["html_table", "html_text"]


def html_text(title: str, text: str) -> str:
    """Text in columns as people read it at the console, below a title that folds it up.

    Parameters
    ----------
    title
        One line.
    text
        Any text; `<`, `>`, `&` and quotes are shown as they are.
    """
    return f"<details open><summary>{_line(title)}</summary><pre>{html.escape(text)}</pre></details>"


def html_table(title: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Records as a table below a title that folds it up.

    Parameters
    ----------
    title
        One line.
    head
        Name of each column.
    rows
        A cell per column; anything that `str` takes.
    """
    names = "".join(f"<th>{_line(name)}</th>" for name in head)
    cells = "".join(f"<tr>{''.join(f'<td>{_line(str(cell))}</td>' for cell in row)}</tr>" for row in rows)
    table = f"<table><thead><tr>{names}</tr></thead><tbody>{cells}</tbody></table>"
    return f"<details open><summary>{_line(title)}</summary>{table}</details>"


def _line(text: str) -> str:
    return html.escape(" ".join(text.split()))
