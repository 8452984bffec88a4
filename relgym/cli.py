"""Learn readable models of what actions do, and ask, test and print them."""

from __future__ import annotations

import json
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from relgym.console.errors import Commands
from relgym.console.options import config_of_options, pairs
from relgym.errors import ConfigError
from relgym.model.reports.text import plain

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from relgym.console.learning import Lesson, Round

__all__ = ["app"]


_FRESH = 1000
"""Test scenes have other seeds than those that a model is likely to have been learned with."""


app = typer.Typer(cls=Commands, no_args_is_help=True, add_completion=False, help=__doc__)

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file, as `relgym learn` writes it.")]
EnvId = Annotated[
    str, typer.Argument(metavar="ENV", help="Env id, such as CartPole-v1 or relgym/BallBoxRamp-v0.")
]
OtherEnv = Annotated[
    str | None, typer.Option("--env", metavar="ID", help="Another env than the one that the file names.")
]
Arguments = Annotated[
    list[str] | None,
    typer.Option("--arg", "-a", metavar="NAME=VALUE", help="Argument of the env; repeatable."),
]
ViewOption = Annotated[
    str | None,
    typer.Option(
        "--view", metavar="VIEW", help="auto, numbers, a FILE.json, or MODULE:NAME of a view of yours."
    ),
]
Names = Annotated[
    str | None, typer.Option("--names", metavar="A,B,...", help="Names of the env's numbers, in order.")
]


def _version(asked: bool) -> None:
    if asked:
        import relgym

        print(f"relgym {relgym.__version__}")
        raise typer.Exit


@app.callback()
def main(
    modules: Annotated[
        list[str] | None,
        typer.Option(
            "--import",
            metavar="MODULE",
            help="Import a module first, which registers envs or features; repeatable.",
        ),
    ] = None,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Learn readable models of what actions do, and ask, test and print them."""
    if modules:
        from relgym.console.envs import imported

        for name in modules:
            imported(name, "--import")


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for models and pictures.")] = Path("out/demo"),
    seed: Seed = 0,
    quick: Annotated[bool, typer.Option(help="Learn from a few episodes only.")] = False,
    jobs: Annotated[int, typer.Option(help="How many processes.", min=1)] = 2,
    as_json: Json = False,
) -> None:
    """Learn the laws of two small worlds from scratch, online; print, measure and draw them."""
    from relgym.experiments.demo import demonstrate_all, demonstrations, draw

    out.mkdir(parents=True, exist_ok=True)
    shown = demonstrations(quick=quick)
    outcomes, dreams = [], []
    with _progress() as bar:
        tasks = {each.name: bar.add_task(each.name, total=each.episodes) for each in shown}
        results = demonstrate_all(
            shown, out, seed=seed, jobs=jobs, told=lambda name, done: bar.update(tasks[name], completed=done)
        )
        for each, (outcome, own) in zip(shown, results, strict=True):
            bar.update(tasks[each.name], completed=each.episodes)
            outcomes.append(outcome)
            dreams.append(own)
            if not as_json:
                typer.echo(outcome)
    pictures: dict[str, str] = {}
    try:
        pictures = draw(out, shown, outcomes, dreams)
    except ConfigError as missing:
        typer.secho(f"no pictures: {missing}", fg="yellow", err=True)
    worlds = {each.name: outcome for each, outcome in zip(shown, outcomes, strict=True)}
    if as_json:
        _echo_json({"worlds": worlds, "pictures": pictures})
    else:
        models = {f"{name} model": outcome.file for name, outcome in worlds.items()}
        typer.echo(f"Written:\n{_columns(models | pictures)}")


@app.command()
def learn(
    out: Annotated[Path, typer.Option(help="Model file to write.")],
    env_id: Annotated[str | None, typer.Argument(metavar="ENV", help="Env id, such as CartPole-v1.")] = None,
    steps: Annotated[int, typer.Option(help="Transitions to learn from.", min=1)] = 10_000,
    arg: Arguments = None,
    features: Annotated[
        list[str] | None,
        typer.Option(metavar="A,B,...", help="Features beside the properties: trig, squares, products, ..."),
    ] = None,
    follow_advice: Annotated[
        bool, typer.Option("--follow-advice", help="Learn again with the features that the model advises.")
    ] = False,
    view: ViewOption = None,
    names: Names = None,
    config: Annotated[
        list[str] | None,
        typer.Option("--config", "-c", metavar="KEY=VALUE", help="Parameter of the learner; repeatable."),
    ] = None,
    reward: Annotated[bool, typer.Option("--reward", help="Learn the reward too.")] = False,
    termination: Annotated[bool, typer.Option("--termination", help="Learn when episodes end too.")] = False,
    seed: Annotated[int | None, typer.Option(help="Seed of everything random; default 0.", min=0)] = None,
    history: Annotated[bool, typer.Option("--history", help="Keep what further learning needs.")] = False,
    resume: Annotated[
        Path | None, typer.Option(metavar="MODEL", help="Go on from a model that was saved with --history.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Watch an env under random actions, learn a model of it, save it and say how good it is.

    Ctrl-C ends it early and saves what was learned.
    """
    from relgym.console.learning import Lesson, lessons

    lesson = Lesson(
        env_id=env_id,
        arguments=pairs("--arg", arg),
        out=out,
        steps=steps,
        seed=seed,
        view=view,
        names=names,
        reward=reward,
        terminated=termination,
        config=config_of_options(config, features),
        resume=resume,
        history=history,
        follow_advice=follow_advice,
    )
    _show_lessons(lessons, lesson, as_json)


@app.command()
def rules(
    model: ModelFile,
    digits: Annotated[int, typer.Option(help="Significant digits of coefficients.", min=1, max=17)] = 7,
    details: Annotated[bool, typer.Option(help="Tables of modes, clauses of each pair, and roles.")] = False,
    check: Annotated[bool, typer.Option(help="Measure on fresh steps how well the text agrees.")] = False,
    steps: Annotated[int, typer.Option(help="So many steps for --check.", min=1)] = 2000,
    env_id: OtherEnv = None,
    arg: Arguments = None,
    view: ViewOption = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Print a model as rules: if, elif, else."""
    from relgym.console.models import loaded, opened
    from relgym.model.reports.report import checked_rules, report
    from relgym.wrappers.follower import scenes_of

    if not check:
        given = {"--env": env_id, "--arg": arg, "--view": view}
        if needless := [name for name, value in given.items() if value]:
            raise ConfigError(
                f"{', '.join(needless)}: rules are those of the file; give --check, too, or leave it out"
            )
        found, fresh = loaded(model), None
    else:
        subject = opened(model, env_id, pairs("--arg", arg), view)
        found, fresh = subject.model, scenes_of(subject.env, subject.view, steps, seed=_FRESH + seed)
    with _working("checking" if check else "writing"):
        if not as_json:
            typer.echo(found.describe(details=details, digits=digits, check=fresh))
        elif details or not found.has_rules:
            _echo_json(report(found, digits=digits))
        else:
            _echo_json(checked_rules(found, digits, check=fresh).plain(digits))


@app.command()
def export(
    model: ModelFile,
    out: Annotated[Path, typer.Argument(metavar="FILE", help="File to write.")],
    to: Annotated[str, typer.Option(help="What to write: python.")] = "python",
    steps: Annotated[int, typer.Option(help="Fresh steps on which to compare.", min=1)] = 24_000,
    env_id: OtherEnv = None,
    arg: Arguments = None,
    view: ViewOption = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Write a model as Python that needs numpy alone, and say how often it says what the model says."""
    from relgym.console.exporting import exported
    from relgym.console.models import opened

    if to != "python":
        raise ConfigError(f"--to={to!r}: expected 'python'")
    with _working("exporting"):
        found = exported(
            opened(model, env_id, pairs("--arg", arg), view), out, steps=steps, seed=_FRESH + seed
        )
    _echo_json(found) if as_json else typer.echo(found)


@app.command()
def explain(
    model: ModelFile,
    step: Annotated[int, typer.Option(help="Random steps to take before.", min=0)] = 0,
    env_id: OtherEnv = None,
    arg: Arguments = None,
    view: ViewOption = None,
    seed: Seed = 0,
) -> None:
    """Say why a model predicts what it predicts in a scene of its env."""
    from relgym.console.models import opened
    from relgym.console.scenes import scene_at

    found = opened(model, env_id, pairs("--arg", arg), view)
    typer.echo(found.model.explain(scene_at(found, step=step, seed=seed)))


@app.command("eval")
def evaluate(
    model: ModelFile,
    steps: Annotated[int, typer.Option(help="Fresh steps to test on.", min=1)] = 1000,
    env_id: OtherEnv = None,
    arg: Arguments = None,
    view: ViewOption = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Test a model one step ahead, on fresh steps with random actions."""
    from relgym.console.models import opened
    from relgym.console.testing import evaluated

    with _working("testing"):
        found = evaluated(opened(model, env_id, pairs("--arg", arg), view), steps=steps, seed=seed)
    _echo_json(found) if as_json else typer.echo(found)


@app.command()
def rollout(
    model: ModelFile,
    trials: Annotated[int, typer.Option(help="Number of roll-outs.", min=1)] = 80,
    steps: Annotated[int, typer.Option(help="Most steps of a roll-out.", min=1)] = 200,
    env_id: OtherEnv = None,
    arg: Arguments = None,
    view: ViewOption = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Let a model imagine whole episodes from their first scenes, and compare with what happens."""
    from relgym.console.models import opened
    from relgym.console.testing import rolled_out

    with _working("testing"):
        subject = opened(model, env_id, pairs("--arg", arg), view)
        found = rolled_out(subject, trials=trials, steps=steps, seed=seed)
    _echo_json(found) if as_json else typer.echo(found)


@app.command()
def reproduce(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME...", help="table-4.2, figure-4.3, experiment-1, ..., all."),
    ] = None,
    batches: Annotated[int | None, typer.Option(help="Trainings per learner, of at most 50.")] = None,
    fast: Annotated[bool, typer.Option(help="A tenth of the tests, fewer checkpoints.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for tables, figures, data and kept results.")] = Path(
        "out/reproduce"
    ),
    page: Annotated[Path | None, typer.Option(help="Also write the page of all results (Markdown).")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; default: one per core.", min=1)] = None,
    backend: Annotated[str, typer.Option(help="local, dask or ray.")] = "local",
    address: Annotated[str | None, typer.Option(help="Of the cluster's scheduler.")] = None,
    listed: Annotated[bool, typer.Option("--list", help="List all names.")] = False,
) -> None:
    """Make the thesis' tables and figures again, beside what it printed; picks up where it was interrupted."""
    from relgym.experiments.chapter4 import command
    from relgym.experiments.chapter4.reproduce import page as write_page

    if listed:
        typer.echo(_columns(command.listing()))
        return
    if names:
        request = command.Request(tuple(names), out, batches, fast, workers, backend, address)
        _show_reproduction(request)
    elif page is None:
        raise ConfigError("name what to reproduce (`relgym reproduce --list`), or a --page to write")
    if page is not None:
        typer.echo(f"{page}: {', '.join(write_page(out, page))}")


@app.command()
def envs(
    every: Annotated[
        bool, typer.Option("--all", help="All that are installed, not only relgym's own.")
    ] = False,
    as_json: Json = False,
) -> None:
    """List relgym's envs, or all that are installed."""
    from relgym.console.envs import listing

    found = listing(every=every)
    _echo_json(found) if as_json else typer.echo(_columns(found))


@app.command()
def dyna(
    out: Annotated[Path, typer.Option(help="Folder for the picture and the runs.")] = Path("out/dyna"),
    steps: Annotated[int, typer.Option(help="Real steps of each agent.", min=1)] = 750,
    seed: Seed = 0,
    learned: Annotated[bool, typer.Option(help="Learn reward and termination too.")] = False,
    as_json: Json = False,
) -> None:
    """Let SAC learn to push a truck to its goal, with a model to dream in and without one (needs sb3)."""
    from relgym.experiments.dyna.demo import demonstrate

    out.mkdir(parents=True, exist_ok=True)
    with _progress() as bar:
        shown = demonstrate(out, steps=steps, seed=seed, learned=learned, bar=bar)
    _echo_json(shown) if as_json else typer.echo(shown)


@app.command()
def plan(
    out: Annotated[Path, typer.Option(help="Folder for the picture.")] = Path("out/plan"),
    steps: Annotated[int, typer.Option(help="Real steps of learning.", min=1)] = 600,
    episodes: Annotated[int, typer.Option(help="Episodes to plan.", min=1)] = 10,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Let an agent explore a truck's world, print the laws and the task it found, and plan some episodes."""
    from relgym.experiments.plan.demo import demonstrate

    out.mkdir(parents=True, exist_ok=True)
    with _working("exploring and learning"):
        shown = demonstrate(out, steps=steps, episodes=episodes, seed=seed)
    _echo_json(shown) if as_json else typer.echo(shown)


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True}, add_help_option=False
)
def benchmark(
    rest: typer.Context,
    name: Annotated[str, typer.Argument(help="laws, plan, ...; without one, all are listed.")] = "",
) -> None:
    """Run benchmarks, or go on with them, and tell them beside their limits (`relgym benchmark plan --help`)."""
    from relgym.experiments.benchmark import main
    from relgym.experiments.suites import listing, suite

    if asked := name in ("--help", "-h"):
        typer.echo(rest.get_help())
    if asked or not name:
        typer.echo(_columns(listing()))
        return
    main(suite(name), rest.args)


@app.command()
def inspect(
    env_id: EnvId, arg: Arguments = None, view: ViewOption = None, names: Names = None, seed: Seed = 0
) -> None:
    """Show an env as relgym sees it: arguments, spaces, objects, properties, the first scene."""
    from relgym.console.envs import made, signature_text
    from relgym.console.views import view_named
    from relgym.experiments.inspection import inspected

    env = made(env_id, pairs("--arg", arg))
    shown = inspected(env, view_named(env, view, names), seed=seed)
    typer.echo(f"{env_id}\n\narguments\n  {signature_text(env)}\n\n{shown}")


@app.command()
def doctor(as_json: Json = False) -> None:
    """Check that all that relgym needs is there and works."""
    from relgym.experiments.inspection import diagnosis

    found = diagnosis()
    if as_json:
        _echo_json(found)
    else:
        typer.echo(_columns({f"{'ok' if f.ok else '--'} {f.name}": f.text for f in found}))
    if not all(f.ok for f in found if f.required):
        raise typer.Exit(1)


# ------------------------------------------------------------------ helpers
def _show_lessons(learned: Callable[..., Iterator[Round]], lesson: Lesson, as_json: bool) -> None:
    """Learn under a progress bar; say what came of each round, and what to do next."""
    from relgym.console.next_steps import next_steps

    rounds: list[Round] = []
    with _progress(TimeRemainingColumn(), TextColumn("{task.fields[wrong]}")) as progress:
        task = progress.add_task("learning", total=lesson.steps, wrong="")

        def tick(done: int, wrong: float) -> None:
            if done < progress.tasks[0].completed:  # another round
                progress.reset(task, total=lesson.steps, wrong="")
            progress.update(task, completed=done, wrong=f"wrong lately: {wrong:.1%}")

        for number, found in enumerate(learned(lesson, tick), start=1):
            rounds.append(found)
            if not as_json:
                typer.echo(f"{'' if number == 1 else chr(10)}{found}")
    if as_json:
        _echo_json(rounds)
    else:
        typer.echo(f"\n{next_steps(rounds[-1])}")
    if rounds[-1].stopped:
        raise typer.Exit(130 if "Ctrl-C" in rounds[-1].stopped else 1)


def _show_reproduction(request: Any) -> None:
    """Run jobs under a progress bar; print every table as it is made."""
    from relgym.experiments.chapter4.command import remaining, reproduce
    from relgym.experiments.jobs.run import Progress as Standing

    with _progress(TextColumn("{task.fields[left]}")) as bar:
        task = bar.add_task("tasks", total=None, left="")
        for event in reproduce(request):
            if isinstance(event, Standing):
                bar.update(task, total=event.total, completed=event.done, left=remaining(event))
            else:
                head = f"{event.name}: {event.title} ({event.source})"
                typer.echo(f"{head}\n{'=' * len(head)}\n{event.text}\n")
    typer.echo(f"Written to {request.out}")


def _progress(*more: ProgressColumn) -> Progress:
    basic = (TextColumn("{task.description:>6}"), BarColumn(40), MofNCompleteColumn(), TimeElapsedColumn())
    columns = (*basic, *more)
    return Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty())


@contextmanager
def _working(what: str) -> Iterator[None]:
    """Show that something is going on, where a person watches."""
    with Console(stderr=True).status(what):
        yield


def _columns(rows: dict[str, str]) -> str:
    width = max(map(len, rows), default=0)
    return "\n".join(f"{name:<{width}}  {text}" for name, text in rows.items())


def _echo_json(value: Any) -> None:
    typer.echo(json.dumps(plain(value), indent=2, ensure_ascii=False))
