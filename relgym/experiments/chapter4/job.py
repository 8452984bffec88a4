"""A job: the tasks that a table or figure rests on, and how it is made from their results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from relgym.experiments.chapter4.protocol import Protocol
from relgym.experiments.jobs.task import Task
from relgym.model.reports.text import Cell

__all__ = ["Job", "Plan", "Shown", "Values"]

Plan: TypeAlias = Mapping[str, Sequence[Task]]
"""Tasks by group: the learner, the baseline, or whatever a figure has a line for."""

Values: TypeAlias = Mapping[str, Sequence[Any]]
"""The tasks' results, likewise."""


@dataclass(frozen=True)
class Shown:
    """A finished table or figure.

    Attributes
    ----------
    text
        For the terminal and the page of results; beside what the thesis printed.
    rows
        The data, the heading first.
    draw
        Writes the figure to a path; none for a table.
    """

    text: str
    rows: Sequence[Sequence[Cell]]
    draw: Callable[[Path], None] | None = None


@dataclass(frozen=True)
class Job:
    """One table or figure of chapter IV.

    Attributes
    ----------
    name
        Such as ``table-4.2``.
    title
        The thesis' caption, shortened.
    source
        Section of the thesis.
    groups
        Other names under which it is asked for, such as ``experiment-1``.
    plan
        Which tasks it needs under a protocol.
    show
        Makes it from their results.
    """

    name: str
    title: str
    source: str
    groups: tuple[str, ...]
    plan: Callable[[Protocol], Plan]
    show: Callable[[Protocol, Values], Shown]
