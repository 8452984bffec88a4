"""What ``make dyna`` shows: the same agent with a model to dream in and without one, at the same real steps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from relgym.envs.tasks import Task
from relgym.errors import ConfigError
from relgym.experiments.dyna.arms import ARMS, COURSES, Course, make_env
from relgym.experiments.dyna.course import ENOUGH, Examination, Run, run
from relgym.experiments.dyna.report import draw_runs
from relgym.experiments.plots import Imagined, Trajectory, draw_trajectories
from relgym.experiments.rollouts import imagined
from relgym.model.world_model import WorldModel, with_action
from relgym.scene.objects import ACTION

if TYPE_CHECKING:
    from rich.progress import Progress

__all__ = ["DynaDemo", "demonstrate", "episodes"]

_QUICK: Final[dict[str, Any]] = {"updates": 20, "catch_up": 5_000}
"""Of Dyna, half of what the comparison takes: on the tuning seeds 100 to 103 as good, in half the time."""

_SHOWN: Final = 3
_FIRST_SHOWN: Final = 90_000  # seed of the first episode that is drawn; they are no selection


@dataclass(frozen=True, slots=True)
class DynaDemo:
    """Both runs, and where the pictures lie.

    Attributes
    ----------
    title
        What the agents had to do.
    runs
        One per arm.
    pictures
        File of each picture by what it shows; why there are none, where none could be drawn.
    """

    title: str
    runs: tuple[Run, ...]
    pictures: dict[str, str]

    def __str__(self) -> str:
        lines = [f"{self.title}: successes of 100 fixed episodes after so many real steps", ""]
        width = max(len(ARMS[r.arm].title) for r in self.runs)
        steps = [f"{at:>6}" for at, _ in self.runs[0].curve]
        lines.append(f"{'real steps':<{width}}  {''.join(steps)}")
        for own in self.runs:
            successes = "".join(f"{good:>6}" for _, good in own.curve)
            lines.append(f"{ARMS[own.arm].title:<{width}}  {successes}")
        lines += ["", *(_told(own) for own in self.runs)]
        laws = next((own.laws for own in self.runs if own.laws), "")
        lines += ["", "What the agent learned of its world, and dreamed in:", "", laws, ""]
        return "\n".join([*lines, *(f"{what}: {where}" for what, where in self.pictures.items())])


def demonstrate(out: Path, *, steps: int, seed: int, learned: bool, bar: Progress) -> DynaDemo:
    """Run both agents and draw their curves, and some real and dreamed episodes.

    Parameters
    ----------
    out
        Folder for the pictures.
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
    exam = Examination(course)
    runs: list[Run] = []
    shown: list[Trajectory] = []

    def met(agent: Any, model: WorldModel | None) -> None:
        if model is not None:
            shown.extend(episodes(agent, model, course))

    for arm in (ARMS["relgym-given" if not learned else "relgym"], ARMS["sac"]):
        task = bar.add_task("SAC" if runs else "dyna", total=steps)

        def heard(at: int, _: int, task: Any = task) -> None:
            bar.update(task, completed=at)

        found = run(
            course,
            arm,
            seed=seed,
            steps=steps,
            testing=exam,
            to_the_end=True,
            heard=heard,
            met=met,
            dyna=_QUICK,
        )
        runs.append(found)
    return DynaDemo(course.title, tuple(runs), _drawn(out, runs, shown, course))


def episodes(agent: Any, model: WorldModel, course: Course) -> list[Trajectory]:
    """Real episodes of an agent, and what the model makes of its actions from the first scene alone.

    Parameters
    ----------
    agent
        Acts at its best.
    model
        Predicts.
    course
        Where.
    """
    env, found = make_env(course), []
    for k in range(_SHOWN):
        seen, _ = env.reset(seed=_FIRST_SHOWN + k)
        over, info = False, dict[str, Any]()
        while not over:
            seen, _, terminated, truncated, info = env.step(agent.predict(seen, deterministic=True)[0])
            over = terminated or truncated
        steps = env.get_wrapper_attr("take")()
        last = steps[-1].transition
        end = with_action(last.before, np.zeros(len(model.schema.type_of(ACTION).properties)))
        end = end.replace({(o.name, prop): o[prop] for o in last.after for prop in o.type.properties})
        real = np.stack([*(step.transition.before.vector for step in steps), end.vector])
        dream, known = imagined(model, real, last.before.layout)
        title = f"episode {k + 1}: {'on the goal' if info['is_success'] else 'not on the goal'}"
        first = steps[0].transition.before
        marks = task.regions(first) if isinstance(task := env.get_wrapper_attr("task"), Task) else ()
        own = Imagined("the model", dream, known)
        found.append(Trajectory(title, first, course.mover, real, (own,), marks))
    return found


def _drawn(out: Path, runs: list[Run], shown: list[Trajectory], course: Course) -> dict[str, str]:
    try:
        return {
            "Learning curves": str(draw_runs(out / "curves.png", runs, course.title)),
            "Real and dreamed": str(draw_trajectories(out / "episodes.png", shown)),
        }
    except ConfigError as missing:
        return {"No pictures": str(missing)}


def _told(own: Run) -> str:
    title = ARMS[own.arm].title
    model = (
        f", of it {own.learning_seconds:.0f} s learning the model and {own.dreaming_seconds:.0f} s dreaming"
    )
    time = f"{own.seconds:.0f} s{model if own.learning_seconds else ''}"
    if own.solved_at is None:
        return f"{title}: not {ENOUGH} of 100 twice in a row; {time}"
    return f"{title}: {ENOUGH} of 100 twice in a row after {own.solved_at:,} real steps; {time}"
