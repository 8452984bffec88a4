"""``relgym learn``: watch an env, learn, save, measure, and say what to do next."""

from __future__ import annotations

import os
import shlex
import signal
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from relgym.config import ModelConfig
from relgym.console.envs import made
from relgym.console.models import loaded, opened
from relgym.console.views import view_named
from relgym.envs.views import TaskView
from relgym.errors import ConfigError, RelgymError
from relgym.experiments.fresh import fresh_episodes, transitions
from relgym.experiments.scores import Score, score
from relgym.model.reports.text import amount
from relgym.wrappers import ModelLearner

__all__ = ["Lesson", "Round", "checked_out", "lessons", "switch"]

TEST = 1000
"""Most fresh steps that a model is tested on when it has been learned."""

ROUNDS = 4
"""How often advice is followed at most."""

Tick = Callable[[int, float], None]
"""Called after each step with the number of steps and the share of the latest ones with a wrong prediction."""


@dataclass(frozen=True, slots=True)
class Lesson:
    """What to learn, as the options say.

    Attributes
    ----------
    env_id, arguments
        Of the env; the id may be None where a model is resumed.
    out
        Where to write.
    steps, seed
        How many transitions, and of everything random; no seed: 0, or with `resume` what the model has seen, so that it
        sees other episodes.
    view, names, reward, terminated
        See `relgym.console.views.view_named`.
    config
        Free parameters.
    resume
        Model file to go on from.
    history
        Whether to keep what further learning needs.
    follow_advice
        Whether to learn again with the features that the model advises, until it names no more.
    """

    env_id: str | None
    arguments: Mapping[str, Any]
    out: Path
    steps: int
    seed: int | None = None
    view: str | None = None
    names: str | None = None
    reward: bool = False
    terminated: bool = False
    config: ModelConfig = field(default_factory=ModelConfig)
    resume: Path | None = None
    history: bool = False
    follow_advice: bool = False


@dataclass(frozen=True, slots=True)
class Round:
    """What came of learning once.

    Attributes
    ----------
    env_id
        The env.
    file
        Where the model was saved.
    features
        Features that were on.
    steps, planned
        Steps that were taken, and how many there should have been.
    seen
        Transitions that the model has learned from in all.
    seconds
        How long that took.
    stopped
        Why it ended early; empty if it didn't.
    score
        Errors on fresh steps; None where it ended early.
    advice
        What isn't explained, and what would explain it.
    advised
        Features to switch on beside those that are; empty if there are none.
    """

    env_id: str
    file: str
    features: tuple[str, ...]
    steps: int
    planned: int
    seen: int
    seconds: float
    stopped: str
    score: Score | None
    advice: tuple[str, ...]
    advised: tuple[str, ...]

    def __str__(self) -> str:
        on = f" with {', '.join(self.features)}" if self.features else ""
        more = f" ({self.seen:,} in all)" if self.seen > self.steps else ""
        head = f"Learned {self.env_id}{on} from {amount(self.steps, 'step')}{more} in {self.seconds:.1f} s: {self.file}"
        if self.stopped:
            head = f"{self.stopped} after {self.steps:,} of {self.planned:,} steps; what was learned is in {self.file}"
        parts = [head, "" if self.score is None else str(self.score), *map(_advice, self.advice)]
        return "\n\n".join(part for part in parts if part)


def switch(features: Iterable[str]) -> str:
    """The option that switches features on, as a shell reads it."""
    return f"--features {shlex.quote(','.join(features))}"


def _advice(text: str) -> str:
    return textwrap.fill(f"Advice for {text}", 100, subsequent_indent="  ")


def checked_out(path: Path) -> Path:
    """A path that a file can be written to, in a folder that is there or can be made.

    Raises
    ------
    ConfigError
        It is a folder, or nothing can be written there.
    """
    if path.is_dir():
        raise ConfigError(f"--out {path} is a folder: expected a file, such as {path / 'model.json'}")
    there = next((p for p in path.absolute().parents if p.exists()), path.parent)
    try:
        with tempfile.TemporaryFile(dir=there):
            pass
        if path.exists() and not os.access(path, os.W_OK):
            raise PermissionError(13, "Permission denied")
    except OSError as error:
        raise ConfigError(
            f"--out {path} can't be written ({error.strerror}): expected a file in a folder that may be written to"
        ) from None
    return path


def lessons(lesson: Lesson, tick: Tick) -> Iterator[Round]:
    """Learn, save and measure; once, or as often as there is new advice to follow.

    All that can be wrong is looked for before the first step. An interrupt (Ctrl-C) ends learning after the step that
    is going on, and what was learned is saved; so it is when the env fails. A round that follows advice and is ended so
    is thrown away: the file then holds the round before.

    Raises
    ------
    ConfigError, ModelFileError
        Something that was asked for can't be had.
    """
    out = checked_out(lesson.out)
    last: Round | None = None
    with _interrupts() as interrupted:
        for _ in range(ROUNDS if lesson.follow_advice else 1):
            learner, env_id = _learner(lesson)
            try:
                found = _learned(learner, lesson, env_id, out, tick, interrupted, last)
            finally:
                learner.close()
            yield found
            if found.stopped or not found.advised:
                return
            last = found
            features = (*found.features, *found.advised)
            lesson = replace(lesson, config=replace(lesson.config, features=features))


def _learner(lesson: Lesson) -> tuple[ModelLearner, str]:
    """The env with a learner around it, and the env's id."""
    if lesson.resume is not None:
        return _resumed(lesson, lesson.resume)
    if lesson.env_id is None:
        raise ConfigError("name the env to learn: relgym learn ENV --out FILE; `relgym envs` lists some")
    env = made(lesson.env_id, lesson.arguments)
    learner = ModelLearner(
        env,
        view=view_named(env, lesson.view, lesson.names),
        config=lesson.config,
        learn_reward=lesson.reward,
        learn_termination=lesson.terminated,
    )
    return learner, lesson.env_id


def _resumed(lesson: Lesson, path: Path) -> tuple[ModelLearner, str]:
    """The env that a model's file names, or another one like it, with a learner that goes on from the model."""
    _check_resumable(lesson, path)
    found = opened(path, lesson.env_id, lesson.arguments, lesson.view)
    view = found.view.view if isinstance(found.view, TaskView) else found.view
    held = found.model.extra.get("view") or {}
    learner = ModelLearner(
        found.env,
        view=view,
        model=path,
        learn_reward=bool(held.get("reward")),
        learn_termination=bool(held.get("terminated")),
    )
    return learner, found.env_id


def _check_resumable(lesson: Lesson, path: Path) -> None:
    """Whether a model can go on; `ConfigError` where it can't, or where something is asked that is settled."""
    if loaded(path).frozen:
        raise ConfigError(
            f"{path} was saved without its history, and can't learn on: learn it anew with --history, which keeps that"
        )
    settled = {
        "--config or --features": lesson.config != ModelConfig(),
        "--follow-advice": lesson.follow_advice,
        "--names": lesson.names is not None,
        "--reward or --termination": lesson.reward or lesson.terminated,
    }
    for option, given in settled.items():
        if given:
            raise ConfigError(
                f"{option} can't go with --resume: {path} keeps what it was begun with; begin anew"
            )


def _learned(
    env: ModelLearner,
    lesson: Lesson,
    env_id: str,
    out: Path,
    tick: Tick,
    interrupted: Callable[[], bool],
    last: Round | None,
) -> Round:
    """Learn once, save, and test what was learned; `last` is the round before."""
    start = time.perf_counter()
    known = 0 if lesson.resume is None else env.model.seen
    seed = known if lesson.seed is None else lesson.seed
    steps, stopped = _run(env, lesson.steps, seed, tick, interrupted)
    seconds = round(time.perf_counter() - start, 2)
    if stopped and last is not None:
        stopped = f"{stopped}; kept the round before,"
        return replace(last, steps=steps, planned=lesson.steps, stopped=stopped, advised=())
    if not steps:
        raise ConfigError(f"{env_id}: {stopped} before the first step; nothing was saved")
    out.parent.mkdir(parents=True, exist_ok=True)
    env.save(out, history=lesson.history or lesson.resume is not None)
    features = env.model.config.features
    done = Round(
        env_id, str(out), features, steps, lesson.steps, env.model.seen, seconds, stopped, None, (), ()
    )
    return done if stopped else _tested(done, env, seed)


def _tested(done: Round, env: ModelLearner, seed: int) -> Round:
    """The round with errors on fresh steps, and advice."""
    found = transitions(fresh_episodes(env.env, env.view, seed=seed), min(TEST, done.planned))
    advice = env.model.advice()
    advised = [each for each in env.model.advised_features() if each not in done.features]
    return replace(
        done,
        score=score(env.model, found, env.view.precision),
        advice=tuple(f"{each.target}: {each.told(switch(each.features))}" for each in advice),
        advised=tuple(advised),
    )


def _run(
    env: ModelLearner, steps: int, seed: int, tick: Tick, interrupted: Callable[[], bool]
) -> tuple[int, str]:
    """Take random actions; how many steps were taken, and why not all."""
    done = 0
    try:
        env.action_space.seed(seed)
        env.reset(seed=seed)
        while done < steps and not interrupted():
            *_, terminated, truncated, _ = env.step(env.action_space.sample())
            done += 1
            if terminated or truncated:
                env.reset()
            if done % 50 == 0 or done == steps:
                tick(done, env.prequential.recent)
    except RelgymError as error:
        return done, f"Stopped, for {type(error).__name__}: {error};"
    except Exception as error:
        # An env of anybody's may fail in any way, and what was learned must not be lost.
        return done, f"Stopped, for the env failed with {type(error).__name__}: {error};"
    return done, "" if done == steps else "Stopped by Ctrl-C"


@contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Whether Ctrl-C was pressed; it doesn't break off what is going on, unless it is pressed twice."""
    pressed: list[int] = []

    def note(number: int, frame: Any) -> None:
        if pressed:
            raise KeyboardInterrupt
        pressed.append(number)

    try:
        usual = signal.signal(signal.SIGINT, note)
    except ValueError:  # not the main thread: whoever runs this there looks after signals
        yield lambda: False
        return
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, usual)
