"""Benchmarks of Dyna: how many real steps it saves and what it costs; each figure beside its limit.

``python -m relgym.experiments.dyna_benchmarks truck --arms relgym sac --seeds 2`` runs two arms with two seeds
each, and reports all that is known of the benchmark. Results are kept in a store: what is there already isn't computed
again, so that the whole comparison (``make dyna-full``) can be stopped and resumed. ``--page`` writes the page of
results.
"""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import date
from pathlib import Path
from typing import Final

from relgym.errors import StoreError
from relgym.experiments.chapter4.reproduce import Made, section
from relgym.experiments.criterion import one_of, report
from relgym.experiments.dyna_arms import ARMS
from relgym.experiments.dyna_measures import BENCHMARKS, Benchmark, Found
from relgym.experiments.jobs.run import run
from relgym.experiments.jobs.store import ResultStore, write_atomically
from relgym.experiments.jobs.task import Task
from relgym.experiments.seeds import TRAINING_SEEDS

__all__ = ["main", "page", "shown", "wanted"]

_HEAD: Final = """# What dreaming is worth

`python -m relgym.experiments.dyna_benchmarks` wrote this page, but for what stands below the tables, which it leaves
alone. Each section is a benchmark. Seeds are 0 to 4, on which nothing was chosen; where a figure is of fewer than
five, no more were run (*of* in the tables). Success is 90 of 100 fixed test episodes twice in a row, checked every 250
real steps; *each* lists the real steps to it, the smallest first. *time* is processor time, tests included (a run has
one thread); *learning* and *dreaming* are wall time on a machine with two cores that did other things too, and so may
be longer. The [guide](../guides/dyna.md) says how it works."""


def wanted(benchmark: Benchmark, *, seeds: int, arms: Sequence[str]) -> list[Task]:
    """Those of a benchmark's tasks that have one of the first seeds (or none) and one of the arms (or none)."""
    few = TRAINING_SEEDS[:seeds]
    return [
        task
        for task in benchmark.tasks
        if task.arguments.get("seed", 0) in few and task.arguments.get("arm", arms[0]) in arms
    ]


def known(benchmark: Benchmark, store: ResultStore) -> tuple[Found, float]:
    """What the store holds of a benchmark, and how many seconds it took."""
    results = [(task.arguments, store.get(task)) for task in benchmark.tasks]
    there = [(arguments, result) for arguments, result in results if result is not None]
    return [(arguments, r.value) for arguments, r in there], sum(r.seconds for _, r in there)


def shown(name: str, store: ResultStore, out: Path, command: str) -> Made:
    """Report a benchmark; writes ``NAME.json`` and, if it has one, its picture.

    Raises
    ------
    StoreError
        Nothing of it has been run.
    """
    benchmark = BENCHMARKS[name]
    found, seconds = known(benchmark, store)
    if not found:
        raise StoreError(f"nothing is known of {name}: run it with at least one seed and arm")
    figures = benchmark.show(found)
    picture = f"dyna-{name}.png" if figures.draw is not None else ""
    if figures.draw is not None:
        out.mkdir(parents=True, exist_ok=True)
        figures.draw(out / picture)
    extent = f"{len(found)} of {len(benchmark.tasks)} runs have been made."
    text = report(benchmark.title, figures.measures, [*figures.notes, extent])
    today = date.today().isoformat()
    made = Made(name, benchmark.title, "Dyna", text, picture, today, command, seconds)
    write_atomically(out / f"{name}.json", json.dumps(asdict(made), indent=1).encode())
    return made


def page(out: Path, target: Path) -> None:
    """Write the page of results from what benchmarks have written, and copy their pictures beside it.

    Of a page that is there already, sections of benchmarks that wrote nothing into this folder stay, and so does what
    was written by hand below the tables.
    """
    old = _sections(target.read_text(encoding="utf-8")) if target.is_file() else {}
    sections = dict(old)
    for made in _made(out):
        if made.figure:
            write_atomically(target.parent / made.figure, (out / made.figure).read_bytes())
        remark = old.get(made.name, "").partition("\n```\n")[2].strip()
        sections[made.name] = section(made, ".") + (f"\n\n{remark}" if remark else "")
    names = {name: benchmark.title for name, benchmark in BENCHMARKS.items()}
    missing = [f"{name}, {title}" for name, title in names.items() if name not in sections]
    rest = [f"Not made yet: {'; '.join(missing)}."] if missing else []
    parts = [_HEAD, *rest, *(sections[name] for name in names if name in sections)]
    write_atomically(target, "\n\n".join(parts).encode() + b"\n")


def _sections(text: str) -> dict[str, str]:
    """The sections of a page of results, by the names of their benchmarks."""
    return {own.split(":")[0]: f"## {own.strip()}" for own in text.split("\n## ")[1:]}


def _made(out: Path) -> Iterator[Made]:
    for name in BENCHMARKS:
        path = out / f"{name}.json"
        if path.is_file():
            yield Made(**json.loads(path.read_text(encoding="utf-8")))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what isn't run yet of the benchmarks named on the command line, then report them."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    parser = argparse.ArgumentParser(description=__doc__)
    names = ", ".join(BENCHMARKS)
    parser.add_argument("benchmarks", nargs="*", type=one_of(BENCHMARKS), help=f"{names}; default: all")
    parser.add_argument("--arms", nargs="+", choices=list(ARMS), default=list(ARMS))
    parser.add_argument("--seeds", type=int, default=len(TRAINING_SEEDS), help="so many, at most 5")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("out/dyna"))
    parser.add_argument("--page", type=Path, help="where to write the page of results")
    chosen = parser.parse_args(given)
    asked = chosen.benchmarks or list(BENCHMARKS)
    store = ResultStore(chosen.out / "cache")
    tasks = [t for n in asked for t in wanted(BENCHMARKS[n], seeds=chosen.seeds, arms=chosen.arms)]
    for progress in run(tasks, store, workers=chosen.jobs):
        print(f"{progress.done} of {progress.total} runs", file=sys.stderr, flush=True)
    for name in asked:
        command = shlex.join(["python", "-m", "relgym.experiments.dyna_benchmarks", name])
        print(shown(name, store, chosen.out, command).text, flush=True)
    if chosen.page is not None:
        page(chosen.out, chosen.page)


if __name__ == "__main__":
    main()
