"""Running jobs and keeping what they show: text, data and figure of each, and a page that holds them all."""

from __future__ import annotations

import csv
import io
import json
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from datetime import date
from pathlib import Path
from typing import Any, Final

from relgym.errors import StoreError
from relgym.experiments.benchmark import Made, kept, section, sections_of
from relgym.experiments.chapter4.canvas import TITLES
from relgym.experiments.chapter4.catalogue import JOBS
from relgym.experiments.chapter4.job import Job, Shown
from relgym.experiments.chapter4.protocol import LEARNERS, Protocol
from relgym.experiments.chapter4.published import REMARKS
from relgym.experiments.chapter4.staleness import declared, digest_of, outdated
from relgym.experiments.jobs.run import Progress, results, run
from relgym.experiments.jobs.store import ResultStore, write_atomically
from relgym.experiments.jobs.task import Task

__all__ = ["compute", "make", "page"]

PAGES: Final = {
    "dream.md": "What dreaming is worth",
    "plan.md": "What planning is worth",
    "bodies.md": "Bodies that push, turn and stack",
    "any-env.md": "Other people's envs",
}
"""Pages of results beside this one, and their titles."""


def compute(jobs: Iterable[Job], protocol: Protocol, store: ResultStore, **where: Any) -> Iterator[Progress]:
    """Compute whatever the jobs need and the store lacks; `where` as of `relgym.experiments.jobs.run.run`."""
    tasks = [task for job in jobs for group in job.plan(protocol).values() for task in group]
    return run(tasks, store, **where)


def make(job: Job, protocol: Protocol, store: ResultStore, out: Path, command: str) -> Made:
    """Make a table or figure from results in the store; writes ``NAME.json``, ``.txt``, ``.csv``, ``.png``.

    Parameters
    ----------
    job, protocol, store
        What to show, at which size, from where.
    out
        Folder to write to.
    command
        How it was asked for.
    """
    plan = job.plan(protocol)
    shown = job.show(protocol, {group: results(tasks, store) for group, tasks in plan.items()})
    text = f"{shown.text}\n\nprinted: {REMARKS[job.name]}" if job.name in REMARKS else shown.text
    figure = f"{job.name}.png" if shown.draw is not None else ""
    made = Made(
        job.name,
        job.title,
        job.source,
        text,
        figure,
        date.today().isoformat(),
        command,
        _seconds(plan, store),
        digest_of(job.name),
        str(protocol),
    )
    write_atomically(out / f"{job.name}.txt", f"{text}\n".encode())
    write_atomically(out / f"{job.name}.csv", _csv(shown).encode())
    if shown.draw is not None:
        write_atomically(out / figure, _drawn(shown))
    else:
        (out / f"{job.name}.png").unlink(missing_ok=True)
    write_atomically(
        out / f"{job.name}.json", json.dumps(asdict(made), indent=1, ensure_ascii=False).encode()
    )
    return made


def _seconds(plan: Mapping[str, Sequence[Task]], store: ResultStore) -> float:
    found = [store.get(task) for task in {t for tasks in plan.values() for t in tasks}]
    return sum(result.seconds for result in found if result is not None)


def _csv(shown: Shown) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(shown.rows)
    return text.getvalue()


def _drawn(shown: Shown) -> bytes:
    assert shown.draw is not None, "tables aren't drawn"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "figure.png"
        shown.draw(path)
        return path.read_bytes()


# ------------------------------------------------------------------ the page of results
def page(out: Path, target: Path) -> list[str]:
    """Write the page of results (Markdown) from what jobs have written, and copy their figures beside it.

    Sections of the page that the folder holds no results of stay as they are.

    Parameters
    ----------
    out
        Folder that jobs have written to.
    target
        The page; figures go to a folder of its name.

    Returns
    -------
    Names of the jobs on it.

    Raises
    ------
    StoreError
        The folder holds no results.
    """
    made = list(kept(JOBS, out, "run `relgym reproduce {name}` again"))
    if not made:
        raise StoreError(f"{out} holds no results: run `relgym reproduce NAME --out {out}` first")
    folder = target.with_suffix("")
    for each in made:
        if each.figure:
            write_atomically(folder / each.figure, (out / each.figure).read_bytes())
        else:  # one of an earlier run shows what is no longer so
            (folder / f"{each.name}.png").unlink(missing_ok=True)
    known = sections_of(target) | {each.name: section(each, folder.name) for each in made}
    sections = [known[name] for name in JOBS if name in known]
    text = "\n\n".join([_head(sections, folder), *sections, ""])
    write_atomically(target, declared(text, outdated(text)).encode())
    return [each.name for each in made]


def _head(sections: Sequence[str], folder: Path) -> str:
    titles = [each.partition("\n")[0].removeprefix("## ") for each in sections]
    learners = "\n".join(f"- **{TITLES[name]}**: {words}" for name, words in LEARNERS.items())
    contents = "\n".join(f"- [{title.rpartition(' (')[0]}](#{_anchor(title)})" for title in titles)
    missing = [name for name in JOBS if name not in {title.partition(":")[0] for title in titles}]
    rest = f"\nNot made yet: {', '.join(missing)}.\n" if missing else ""
    pages = [
        f"- [{title}]({folder.name}/{name})" for name, title in PAGES.items() if (folder / name).is_file()
    ]
    more = "\nOther pages:\n\n" + "\n".join(pages) + "\n" if pages else ""
    return (
        "# Results\n\n"
        "Chapter IV of the thesis again, each table and figure beside what was printed. `relgym reproduce` wrote this "
        "page; nothing\non it is typed by hand. *printed* is what the thesis says, § one of its sections; velocities "
        "are in units per step.\n"
        f"{more}\n"
        f"Learners:\n\n{learners}\n\n{contents}\n{rest}"
    )


def _anchor(title: str) -> str:
    return "".join(c for c in title.lower().replace(" ", "-") if c.isalnum() or c in "-_")
