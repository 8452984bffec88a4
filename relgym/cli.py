"""Learn readable models of what actions do, and ask, test and print them."""

from __future__ import annotations

import json
import sys
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
)
from typer.core import TyperGroup

from relgym.errors import ConfigError, RelgymError
from relgym.model.text import plain

if TYPE_CHECKING:
    from relgym.experiments.demo import Demonstration, DemoOutcome
    from relgym.experiments.plots import Trajectory

__all__ = ["app"]


_FRESH = 1000
"""Test scenes have other seeds than those that a model is likely to have been learned with."""


class _Commands(TyperGroup):
    """Commands whose foreseeable errors end in a sentence, not in a traceback."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except (RelgymError, OSError) as error:
            typer.secho(f"relgym: {error}", fg="red", err=True)
            raise typer.Exit(2) from None


app = typer.Typer(cls=_Commands, no_args_is_help=True, add_completion=False, help=__doc__)

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]
ModelFile = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file, as `relgym learn` writes it.")]
EnvId = Annotated[str, typer.Argument(metavar="ENV", help="Env id, such as relgym/BallBoxRamp-v0.")]
Arguments = Annotated[
    list[str] | None,
    typer.Option("--arg", "-a", metavar="NAME=VALUE", help="Argument of the env; repeatable."),
]
World = Annotated[str, typer.Option("--world", help="Whose test scenes: truck or ball (experiment 1).")]


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder for models and pictures.")] = Path("out/demo"),
    seed: Seed = 0,
    quick: Annotated[bool, typer.Option(help="Learn from a few episodes only.")] = False,
    as_json: Json = False,
) -> None:
    """Learn the laws of two small worlds from scratch, online; print, measure and draw them."""
    from relgym.experiments.demo import demonstrations, draw

    out.mkdir(parents=True, exist_ok=True)
    outcomes, paths = {}, []
    for shown in demonstrations(quick=quick):
        outcomes[shown.name], own = _demonstrate(shown, out, seed)
        paths += own
        if not as_json:
            typer.echo(outcomes[shown.name])
    pictures: dict[str, str] = {}
    try:
        pictures = draw(out, outcomes.values(), paths[::-1])
    except ConfigError as missing:
        typer.secho(f"no pictures: {missing}", fg="yellow", err=True)
    if as_json:
        _echo_json({"worlds": outcomes, "pictures": pictures})
    else:
        models = {f"{name} model": outcome.file for name, outcome in outcomes.items()}
        typer.echo(f"Written:\n{_columns(models | pictures)}")


@app.command()
def learn(
    env_id: EnvId,
    out: Annotated[Path, typer.Option(help="Model file to write.")],
    steps: Annotated[int, typer.Option(help="Transitions to learn from.", min=1)] = 10_000,
    arg: Arguments = None,
    seed: Seed = 0,
    history: Annotated[bool, typer.Option(help="Keep what further learning needs.")] = False,
) -> None:
    """Watch an env under random actions, learn a model of it and save it."""
    from relgym.wrappers import ModelLearner

    env: Any = ModelLearner(_make(env_id, arg))
    env.action_space.seed(seed)
    env.reset(seed=seed)
    with _progress() as bar:
        task = bar.add_task(env_id, total=steps)
        for _ in range(steps):
            *_, terminated, truncated, _ = env.step(env.action_space.sample())
            if terminated or truncated:
                env.reset()
            bar.advance(task)
    env.save(out, history=history)
    typer.echo(f"{env.model!r}\n{out}")


@app.command()
def rules(
    model: ModelFile,
    digits: Annotated[int, typer.Option(help="Significant digits of coefficients.", min=1, max=17)] = 7,
    as_json: Json = False,
) -> None:
    """Print a model: modes, functions, clauses, roles."""
    from relgym.model.world_model import WorldModel

    loaded = WorldModel.load(model)
    _echo_json(_report(loaded, digits)) if as_json else typer.echo(loaded.describe(digits=digits))


@app.command()
def explain(
    model: ModelFile,
    env_id: EnvId,
    step: Annotated[int, typer.Option(help="Which scene of the episode.", min=0)] = 0,
    arg: Arguments = None,
    seed: Seed = 0,
) -> None:
    """Say why a model predicts what it predicts in a scene of an env."""
    from relgym.model.world_model import WorldModel
    from relgym.wrappers.views import view_of

    loaded = WorldModel.load(model)
    env: Any = _make(env_id, arg)
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed)
    # The model's own view knows which numbers are an angle, say; an env of scenes has others of its own.
    view = view_of(env, None if env.has_wrapper_attr("schema") else loaded.extra.get("view"))
    scene = view.scene(observation, info)
    for taken in range(step):
        observation, _, terminated, truncated, info = env.step(env.action_space.sample())
        scene = view.scene(observation, info, last=scene)
        if (terminated or truncated) and taken + 1 < step:
            raise ConfigError(
                f"--step {step}: the episode was over after {taken + 1} steps; try another --seed"
            )
    typer.echo(loaded.explain(view.with_action(scene, env.action_space.sample())))


@app.command("eval")
def evaluate(model: ModelFile, world: World, seed: Seed = _FRESH, as_json: Json = False) -> None:
    """Test a model one step ahead, on fresh scenes of the world that it was learned in."""
    from relgym.experiments import evaluate as evaluation
    from relgym.model.world_model import WorldModel

    shown = _demonstration(world)
    found = evaluation.evaluate(WorldModel.load(model), shown.testing(seed), shown.laws)
    _echo_json(found) if as_json else typer.echo(found)


@app.command()
def rollout(
    model: ModelFile,
    world: World,
    seed: Seed = _FRESH,
    trials: Annotated[int, typer.Option(help="Number of roll-outs.", min=1)] = 80,
    as_json: Json = False,
) -> None:
    """Let a model imagine whole episodes from their first scenes, and compare with what happens."""
    from itertools import islice

    from relgym.experiments.rollouts import rollouts
    from relgym.model.world_model import WorldModel

    found = rollouts(WorldModel.load(model), list(islice(_demonstration(world).testing(seed), trials)))
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
def envs(as_json: Json = False) -> None:
    """List relgym's envs."""
    import gymnasium

    import relgym  # noqa: F401 - registers them

    found = {}
    for spec in gymnasium.registry.values():
        if spec.namespace == "relgym":
            lines = (gymnasium.envs.registration.load_env_creator(str(spec.entry_point)).__doc__ or "").split(
                "\n"
            )
            found[spec.id] = lines[0]
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
    from relgym.experiments.dyna_demo import demonstrate

    out.mkdir(parents=True, exist_ok=True)
    with _progress() as bar:
        shown = demonstrate(out, steps=steps, seed=seed, learned=learned, bar=bar)
    _echo_json(shown) if as_json else typer.echo(shown)


@app.command()
def inspect(env_id: EnvId, arg: Arguments = None, seed: Seed = 0) -> None:
    """Show an env's schema, and the relations in its first scene."""
    from relgym.experiments.inspection import inspected

    typer.echo(inspected(_make(env_id, arg), seed=seed))


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
def _demonstrate(shown: Demonstration, out: Path, seed: int) -> tuple[DemoOutcome, list[Trajectory]]:
    """Learn one world under a progress bar, save the model and measure it."""
    from relgym.experiments.demo import DemoOutcome, learn_online, measure, trajectories

    env, curve = shown.make(), []
    with _progress() as bar:
        task = bar.add_task(shown.name, total=shown.episodes)
        for episode in learn_online(env, shown, seed=seed):
            curve.append(episode)
            bar.advance(task)
        seconds = round(bar.tasks[task].elapsed or 0.0, 2)
    file, steps = out / f"{shown.name}.json", sum(episode.steps for episode in curve)
    env.save(file)
    figures = measure(env.model, shown, seed=seed + _FRESH)
    outcome = DemoOutcome(shown.title, steps, seconds, _report(env.model), figures, tuple(curve), str(file))
    return outcome, trajectories(env.model, shown, seed=figures.seed)


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


def _demonstration(world: str) -> Demonstration:
    from relgym.experiments.demo import demonstrations

    known = {shown.name: shown for shown in demonstrations()}
    if world not in known:
        raise ConfigError(f"--world {world}: expected one of {sorted(known)}")
    return known[world]


def _make(env_id: str, arguments: list[str] | None) -> Any:
    import gymnasium

    import relgym  # noqa: F401 - registers the envs

    try:
        return gymnasium.make(env_id, **dict(map(_argument, arguments or [])))
    except gymnasium.error.Error as error:
        raise ConfigError(f"{error}; `relgym envs` lists relgym's own") from None
    except (ImportError, TypeError, ValueError) as error:
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(f"{env_id} with {arguments or 'no arguments'} can't be made: {error}") from None


def _argument(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ConfigError(f"--arg {text}: expected NAME=VALUE, the value in JSON or a plain word")
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


def _report(model: Any, digits: int = 7) -> Any:
    from relgym.model.report import report

    return report(model, digits=digits)


def _progress(*more: ProgressColumn) -> Progress:
    basic = (TextColumn("{task.description:>6}"), BarColumn(40), MofNCompleteColumn(), TimeElapsedColumn())
    columns = (*basic, *more)
    return Progress(*columns, console=Console(stderr=True), transient=not sys.stderr.isatty())


def _columns(rows: dict[str, str]) -> str:
    width = max(map(len, rows), default=0)
    return "\n".join(f"{name:<{width}}  {text}" for name, text in rows.items())


def _echo_json(value: Any) -> None:
    typer.echo(json.dumps(plain(value), indent=2, ensure_ascii=False))
