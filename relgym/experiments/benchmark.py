"""Benchmarks: how one is declared, run, resumed, printed and kept on a page of results.

A `Benchmark` is a function that asks for results of tasks, as many as are `Known` by now, and makes figures of them,
each beside its limit. It is called twice: first to find out what has to be run, then to tell what came of it. So what
is there already isn't computed again, however a run was stopped, and part of a benchmark can be told. Benchmarks that
share a page are a `Suite`; `relgym benchmark` runs them (`relgym.experiments.suites`)::

    def _accuracy(extent: Extent, known: Known) -> Shown:
        found = known("package.module:trial", [{"seed": seed} for seed in extent.first(SEEDS)])
        return Shown([measured("wrong of 1,000", 0, [each["wrong"] for each in found])])

    SUITE = Suite("mine", "What is measured", {"accuracy": Benchmark("Accuracy", _accuracy)}, seeds=len(SEEDS))
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import date
from pathlib import Path
from typing import Any, TypeVar

from relgym.errors import ConfigError, StoreError
from relgym.experiments.criterion import Measure, one_of, report
from relgym.experiments.jobs.run import run
from relgym.experiments.jobs.store import ResultStore, write_atomically
from relgym.experiments.jobs.task import Task

__all__ = [
    "Benchmark",
    "Extent",
    "Known",
    "Made",
    "Option",
    "Shown",
    "Suite",
    "kept",
    "made",
    "main",
    "page",
    "section",
    "sections_of",
    "whole",
]

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True)
class Option:
    """What may be said of how a suite is run, besides its seeds: ``--name VALUE``.

    Attributes
    ----------
    default
        Its value where nothing is said; values have its type. A tuple takes several values, False is a switch.
    about
        What it is, for people.
    choices
        What it may be; empty: anything.
    """

    default: Any
    about: str
    choices: tuple[str, ...] = ()

    def add_to(self, parser: argparse.ArgumentParser, name: str) -> None:
        """Let a command line take it."""
        if self.default is False:
            parser.add_argument(f"--{name}", action="store_true", help=self.about)
            return
        several = isinstance(self.default, tuple)
        kind = str if several else type(self.default)
        parser.add_argument(
            f"--{name}",
            type=one_of(self.choices) if self.choices else kind,
            nargs="+" if several else None,
            default=self.default,
            help=f"{self.about} (default: {'all' if several else self.default})",
        )


@dataclass(frozen=True, slots=True)
class Extent:
    """How much is run.

    Attributes
    ----------
    seeds
        So many of the seeds that a benchmark has.
    options
        Values of the suite's options.
    """

    seeds: int
    options: Mapping[str, Any] = field(default_factory=dict)

    def first(self, seeds: Sequence[_T]) -> Sequence[_T]:
        """The first of some seeds (or of some pairs of them)."""
        return seeds[: self.seeds]

    def __getitem__(self, option: str) -> Any:
        return self.options[option]


class Known:
    """Results that a store holds; what it is asked for in vain is noted.

    Parameters
    ----------
    store
        None knows nothing.

    Attributes
    ----------
    asked, missing
        Tasks that were asked for, and those that have to be run.
    found, seconds
        Results there were, and how long they took to compute, together.
    """

    def __init__(self, store: ResultStore | None = None) -> None:
        self._store = store
        self.asked: list[Task] = []
        self.missing: list[Task] = []
        self.found = 0
        self.seconds = 0.0

    def __call__(self, function: str, arguments: Sequence[Mapping[str, Any]]) -> list[Any]:
        """Results of ``"package.module:function"`` for those arguments of which they are known, in their order."""
        return [value for _, value in self.pairs(function, arguments)]

    def pairs(
        self, function: str, arguments: Sequence[Mapping[str, Any]]
    ) -> list[tuple[Mapping[str, Any], Any]]:
        """The same, each with its arguments."""
        kind = function.partition(":")[2]
        found = self.of([Task(function, each, kind) for each in arguments])
        return [(task.arguments, value) for task, value in found]

    def whole(self, function: str, arguments: Mapping[str, Any]) -> Shown:
        """What a function tells of a whole benchmark (`Shown.to_json`); nothing as long as that isn't known."""
        found = self(function, [arguments])
        return Shown.from_json(found[0]) if found else Shown()

    def of(
        self, tasks: Sequence[Task], wanted: Callable[[Task], bool] = lambda task: True
    ) -> list[tuple[Task, Any]]:
        """Those tasks whose results are known, with them; of the others, those that are wanted have to be run."""
        found = []
        for task in tasks:
            self.asked.append(task)
            result = None if self._store is None else self._store.get(task)
            if result is not None:
                found.append((task, result.value))
                self.found += 1
                self.seconds += result.seconds
            elif wanted(task):
                self.missing.append(task)
        return found


@dataclass(frozen=True, slots=True)
class Shown:
    """What a benchmark tells.

    Attributes
    ----------
    measures
        Figures beside their limits.
    notes
        Tables and sentences beneath.
    draw
        Writes a picture to a path; None: there is none.
    """

    measures: Sequence[Measure] = ()
    notes: Sequence[str] = ()
    draw: Callable[[Path], Any] | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain data, without the picture: what a task returns that measures a whole benchmark (`whole`)."""
        return {"measures": [m.to_json() for m in self.measures], "notes": list(self.notes)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Shown:
        """Read what `to_json` wrote."""
        return cls([Measure.from_json(each) for each in data["measures"]], data["notes"])


@dataclass(frozen=True, slots=True)
class Benchmark:
    """Something that is measured.

    Attributes
    ----------
    title
        In a few words.
    measure
        Figures of what is known; of nothing, none. It asks for the same tasks whatever is known.
    """

    title: str
    measure: Callable[[Extent, Known], Shown]


def whole(title: str, function: str, arguments: Mapping[str, Any], seeds: Sequence[Any]) -> Benchmark:
    """A benchmark that is one task: a function of some seeds that returns `Shown.to_json`.

    Parameters
    ----------
    title
        Of the benchmark.
    function
        ``"package.module:name"``.
    arguments
        Its arguments besides `seeds`.
    seeds
        All that there are.
    """

    def measure(extent: Extent, known: Known) -> Shown:
        return known.whole(function, {**arguments, "seeds": list(extent.first(seeds))})

    return Benchmark(title, measure)


@dataclass(frozen=True, slots=True)
class Suite:
    """Benchmarks that are asked for together, and share a page.

    Attributes
    ----------
    name, title
        Of the suite.
    benchmarks
        By name, in the order of the page.
    seeds
        How many are run of each benchmark, unless others are asked for.
    options
        What else may be said, by name.
    head
        How the page begins, below its title.
    usual
        What is run where nothing is named; empty: all.
    """

    name: str
    title: str
    benchmarks: Mapping[str, Benchmark]
    seeds: int
    options: Mapping[str, Option] = field(default_factory=dict)
    head: str = ""
    usual: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if unknown := set(self.usual) - set(self.benchmarks):
            raise ConfigError(f"suite {self.name!r}: {sorted(unknown)[0]!r} is usual, and no benchmark of it")

    def extent(self, **said: Any) -> Extent:
        """All of it, but for what is said."""
        options = {name: option.default for name, option in self.options.items()}
        return Extent(said.pop("seeds", self.seeds), options | said)

    def command(self, name: str, extent: Extent) -> str:
        """The command that runs one of its benchmarks so far."""
        parts = ["relgym", "benchmark", self.name, name]
        if extent.seeds != self.seeds:
            parts += ["--seeds", str(extent.seeds)]
        for option, known in self.options.items():
            if (value := extent[option]) != known.default:
                values = value if isinstance(value, list | tuple) else [] if value is True else [value]
                parts += [f"--{option}", *map(str, values)]
        return shlex.join(parts)


@dataclass(frozen=True, slots=True)
class Made:
    """A part of a page of results, as it is kept in a file.

    Attributes
    ----------
    name, title, source
        Of what was made; the source may be empty.
    text
        Tables.
    figure
        File name of the picture; empty: there is none.
    day, command
        When and how it was made.
    seconds
        Of computing, all tasks together.
    code
        Digest of the code behind it; empty where nobody looks at that.
    protocol
        How thoroughly, for people.
    figures
        `Measure.to_json` of each figure.
    """

    name: str
    title: str
    source: str
    text: str
    figure: str
    day: str
    command: str
    seconds: float
    code: str = ""
    protocol: str = ""
    figures: Sequence[Mapping[str, Any]] = ()


def section(one: Made, folder: str) -> str:
    """A part of a page of results: its heading, how it was made, its picture in `folder`, its text."""
    source = f" ({one.source})" if one.source else ""
    picture = f"\n\n![{one.title}]({folder}/{one.figure})" if one.figure else ""
    code = f"; code `{one.code}`" if one.code else ""
    protocol = f"; {one.protocol}" if one.protocol else ""
    how = f"`{one.command}`, {one.day}{code}{protocol}; {one.seconds:.0f} s of computing."
    return f"## {one.name}: {one.title}{source}\n\n{how}{picture}\n\n```text\n{one.text.rstrip()}\n```"


def sections_of(target: Path) -> dict[str, str]:
    """The sections of a page of results, by the first word of their headings; none if there is no such page."""
    if not target.is_file():
        return {}
    parts = target.read_text(encoding="utf-8").split("\n## ")[1:]
    return {part.partition("\n")[0].partition(":")[0]: f"## {part.rstrip()}" for part in parts}


# ------------------------------------------------------------------ running
def made(suite: Suite, name: str, extent: Extent, store: ResultStore, out: Path) -> Made:
    """Tell what is known of a benchmark; writes ``NAME.json`` and, if it has one, its picture.

    Raises
    ------
    StoreError
        Nothing of it has been run.
    """
    benchmark, known = suite.benchmarks[name], Known(store)
    shown = benchmark.measure(extent, known)
    if not known.found:
        raise StoreError(f"nothing is known of {name}: run it, with at least one seed")
    picture = f"{suite.name}-{name}.png" if shown.draw is not None else ""
    if shown.draw is not None:
        out.mkdir(parents=True, exist_ok=True)
        shown.draw(out / picture)
    total = len(known.asked)
    rest = [] if known.found == total else [f"{known.found} of {total} runs have been made."]
    one = Made(
        name,
        benchmark.title,
        "",
        report(benchmark.title, shown.measures, [*shown.notes, *rest]),
        picture,
        date.today().isoformat(),
        suite.command(name, extent),
        known.seconds,
        figures=[m.to_json() for m in shown.measures],
    )
    write_atomically(out / f"{name}.json", json.dumps(asdict(one), indent=1).encode())
    return one


def page(suite: Suite, out: Path, target: Path) -> None:
    """Write the page of results from what benchmarks have written, and copy their pictures beside it.

    Of a page that is there already, sections of which this folder holds nothing stay, and so does what was written by
    hand below the tables and in sections of other names.
    """
    sections = sections_of(target)
    for one in kept(suite.benchmarks, out):
        if one.figure:
            write_atomically(target.parent / one.figure, (out / one.figure).read_bytes())
        remark = sections.get(one.name, "").partition("\n```\n")[2].strip()
        sections[one.name] = section(one, ".") + (f"\n\n{remark}" if remark else "")
    missing = [f"{k}, {b.title}" for k, b in suite.benchmarks.items() if k not in sections]
    rest = [f"Not made yet: {'; '.join(missing)}."] if missing else []
    own = [sections.pop(name) for name in suite.benchmarks if name in sections]
    parts = [f"# {suite.title}", *([suite.head] if suite.head else []), *rest, *own, *sections.values()]
    write_atomically(target, "\n\n".join(parts).encode() + b"\n")


def kept(names: Iterable[str], out: Path, mend: str = "delete it, and run {name} again") -> Iterator[Made]:
    """What was made of these names, as far as a folder holds it; `mend` says what to do about a damaged file.

    Raises
    ------
    StoreError
        A file is damaged.
    """
    for name in names:
        path = out / f"{name}.json"
        if path.is_file():
            try:
                yield Made(**json.loads(path.read_text(encoding="utf-8")))
            except (ValueError, TypeError) as error:
                raise StoreError(f"{path} is damaged ({error}); {mend.format(name=name)}") from error


def main(suite: Suite, arguments: Sequence[str]) -> None:
    """Run what isn't run yet of the benchmarks named on the command line, then tell what is known of them.

    Parameters
    ----------
    suite
        What can be named.
    arguments
        Of the command line, behind the suite's name.
    """
    names = ", ".join(suite.benchmarks)
    parser = argparse.ArgumentParser(prog=f"relgym benchmark {suite.name}", description=suite.title)
    usual = ", ".join(suite.usual) or "all"
    parser.add_argument(
        "benchmarks",
        nargs="*",
        type=one_of(suite.benchmarks),
        metavar="name",
        help=f"{names} (default: {usual})",
    )
    parser.add_argument(
        "--seeds", type=int, default=suite.seeds, help=f"how many seeds (default: {suite.seeds})"
    )
    for name, option in suite.options.items():
        option.add_to(parser, name)
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    parser.add_argument("--out", type=Path, help=f"folder for results (default: out/{suite.name})")
    parser.add_argument("--page", type=Path, help="also write the page of results there")
    parser.add_argument("--report", action="store_true", help="run nothing, tell what is known")
    parser.add_argument(
        "--again",
        action="store_true",
        help="run what is known once more, too: times are those of the machine and the hour they were taken",
    )
    given = parser.parse_args(arguments)
    out = given.out or Path("out", suite.name)
    extent = Extent(given.seeds, {name: getattr(given, name.replace("-", "_")) for name in suite.options})
    asked = given.benchmarks or suite.usual or tuple(suite.benchmarks)
    store = ResultStore(out / "cache")
    if not given.report:
        _run(suite, asked, extent, store, workers=given.jobs, again=given.again)
    for name in asked:
        print(f"{made(suite, name, extent, store, out).text}\n", flush=True)
    if given.page is not None:
        given.page.parent.mkdir(parents=True, exist_ok=True)
        page(suite, out, given.page)


def _run(
    suite: Suite, names: Collection[str], extent: Extent, store: ResultStore, *, workers: int, again: bool
) -> None:
    """Run what some benchmarks ask for."""
    wanted = Known(None if again else store)
    for name in names:
        suite.benchmarks[name].measure(extent, wanted)
    if again:
        for task in wanted.missing:
            store.path(task).unlink(missing_ok=True)
    for progress in run(wanted.missing, store, workers=workers):
        if progress.total:
            print(f"{progress.done} of {progress.total} runs", file=sys.stderr, flush=True)
