"""What ``make dyna`` shows: the same agent with a model to dream in and without one, at the same real steps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from relgym.errors import ConfigError
from relgym.experiments.dyna import ENOUGH, Examination, Run, run
from relgym.experiments.dyna_arms import ARMS, COURSES
from relgym.experiments.dyna_report import draw_runs

if TYPE_CHECKING:
    from rich.progress import Progress

__all__ = ["DynaDemo", "demonstrate"]


@dataclass(frozen=True, slots=True)
class DynaDemo:
    """Both runs, and where the picture lies.

    Attributes
    ----------
    title
        What the agents had to do.
    runs
        One per arm.
    picture
        The learning curves; a sentence where none could be drawn.
    """

    title: str
    runs: tuple[Run, ...]
    picture: str

    def __str__(self) -> str:
        lines = [f"{self.title}: successes of 100 fixed episodes after so many real steps", ""]
        width = max(len(ARMS[r.arm].title) for r in self.runs)
        steps = [f"{at:>6}" for at, _ in self.runs[0].curve]
        lines.append(f"{'real steps':<{width}}  {''.join(steps)}")
        for own in self.runs:
            successes = "".join(f"{good:>6}" for _, good in own.curve)
            lines.append(f"{ARMS[own.arm].title:<{width}}  {successes}")
        lines += ["", *(_told(own) for own in self.runs), ""]
        laws = next((own.laws for own in self.runs if own.laws), "")
        return "\n".join(
            [*lines, "What the agent learned of its world, and dreamed in:", "", laws, "", self.picture]
        )


def demonstrate(out: Path, *, steps: int, seed: int, learned: bool, bar: Progress) -> DynaDemo:
    """Run both agents and draw their curves.

    Parameters
    ----------
    out
        Folder for the picture.
    steps
        Real steps of each.
    seed
        Of everything random.
    learned
        Whether reward and termination are learned too.
    bar
        Where progress is shown.
    """
    course = COURSES["truck"]
    testing = Examination(course)
    runs: list[Run] = []
    for arm in (ARMS["relgym" if learned else "relgym-given"], ARMS["sac"]):
        task = bar.add_task("SAC" if runs else "dyna", total=steps)
        found = run(
            course,
            arm,
            seed=seed,
            steps=steps,
            testing=testing,
            to_the_end=True,
            heard=lambda at, _, task=task: bar.update(task, completed=at),  # type: ignore[misc]
        )
        runs.append(found)
    try:
        picture = f"Learning curves: {draw_runs(out / 'curves.png', runs, course.title)}"
    except ConfigError as missing:
        picture = f"no picture: {missing}"
    return DynaDemo(course.title, tuple(runs), picture)


def _told(own: Run) -> str:
    title = ARMS[own.arm].title
    model = (
        f", of it {own.learning_seconds:.0f} s learning the model and {own.dreaming_seconds:.0f} s dreaming"
    )
    time = f"{own.seconds:.0f} s{model if own.learning_seconds else ''}"
    if own.solved_at is None:
        return f"{title}: not {ENOUGH} of 100 twice in a row; {time}"
    return f"{title}: {ENOUGH} of 100 twice in a row after {own.solved_at:,} real steps; {time}"
