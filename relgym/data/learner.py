"""Learning from recorded episodes exactly as `ModelLearner` does while they are lived through."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import gymnasium as gym

from relgym.arguments import refusing, refusing_calls
from relgym.config import ModelConfig
from relgym.config.checks import checked_count
from relgym.data.dataset import Dataset, Episode
from relgym.envs.views import TaskView, View, view_from_json
from relgym.errors import ConfigError, DataError, ObservationError
from relgym.model.learning.fitting import Progress
from relgym.model.predicting.prequential import StepReport
from relgym.model.predicting.score import Score, scored
from relgym.model.world_model import WorldModel
from relgym.scene.objects import TASK, Transition
from relgym.wrappers.follower import BadObservations, Follower
from relgym.wrappers.learning import Learning
from relgym.wrappers.observer import Observer, Step
from relgym.wrappers.settings import PlainTarget, targets_of
from relgym.wrappers.views import ViewLike, chosen_view, readable

__all__ = ["DataLearner", "fit", "progressive", "score"]


@refusing_calls(ConfigError)
class DataLearner(Learning):
    """Goes through recorded episodes as `ModelLearner` goes through an env: predict, compare, learn.

    The model is the same, to the last byte of its file, as that of a `ModelLearner` which saw the episodes happen.
    `relgym.fit` is this class in one call; by itself it also tells the `view`, and `predict` answers in the env's
    terms.

    Parameters
    ----------
    data
        A `Dataset`, or what `Dataset.from_minari` or `Dataset.from_episodes` take.
    view, targets, config, learn, predict, learn_reward, learn_termination, model, window
        As of `relgym.wrappers.ModelLearner`.
    bad_observations
        ``"raise"`` (default) `DataError`, before anything is learned; ``"skip"`` leaves them out, counted in `skipped`.
    env
        As of `Dataset.from_minari` and `Dataset.from_episodes`; a `Dataset` knows its own.

    Raises
    ------
    DataError
        Data that can't be read, or rewards to be learned that nobody wrote down.
    ConfigError
        Spaces that need a view of the user's, a view of other actions, unknown parameters, or a model of another
        world.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> data = Dataset.collect(gym.make("relgym/TruckPush-v0", task=None), 60, seed=0)
    >>> learner = DataLearner(data, targets=["truck.vx"])
    >>> reports = list(learner)
    >>> len(reports), reports[0].wrong  # nothing learned yet
    (60, (('truck', 'vx'),))
    >>> learner.model.seen
    60
    """

    def __init__(
        self,
        data: Any,
        *,
        view: ViewLike = None,
        targets: Sequence[PlainTarget] | None = None,
        config: ModelConfig | Mapping[str, Any] | None = None,
        model: WorldModel | str | os.PathLike[str] | None = None,
        learn: bool = True,
        predict: bool = True,
        learn_reward: bool = False,
        learn_termination: bool = False,
        bad_observations: BadObservations = "raise",
        window: int = 1000,
        env: gym.Env[Any, Any] | None = None,
    ) -> None:
        self.data = dataset = _dataset(data, env)
        if learn_reward and any(episode.rewards is None for episode in dataset):
            raise DataError(
                "rewards weren't recorded: pass rewards= to Dataset.from_arrays, or leave out learn_reward"
            )
        chosen = chosen_view(
            view,
            dataset.observation_space,
            dataset.action_space,
            schema=dataset.schema,
            reward=learn_reward,
            terminated=learn_termination,
        )
        self._observer = Observer(
            chosen,
            dataset.observation_space,
            dataset.action_space,
            targets=targets,
            config=config,
            model=model,
            learn=learn,
            predict=predict,
            window=window,
            bad_observations=bad_observations,
            metadata=dataset.metadata,
        )
        if bad_observations == "raise":  # found before anything is learned, so that nothing is half learned
            for _ in _transitions(chosen, dataset, None, "raise"):
                pass

    def __iter__(self) -> Iterator[StepReport]:
        """Go through all episodes once; a report after every step. Once more is to learn once more."""
        observer = self._observer
        follower = observer.followers[0]
        for episode in self.data:
            follower.forget()
            observer.begin({0: (episode.observations[0], episode.info(0))})
            for k, action in enumerate(episode.actions):
                known = readable(self.data.action_space, action)
                before = follower.act(known)
                prediction = observer.expect(before)
                yield observer.follow(0, before, prediction, _step(episode, k, known))
        observer.note()

    def run(self) -> DataLearner:
        """Go through all episodes once; returns itself."""
        for _ in self:
            pass
        return self


@refusing(ConfigError)
def fit(
    data: Any,
    *,
    view: ViewLike = None,
    targets: Sequence[PlainTarget] | None = None,
    config: ModelConfig | Mapping[str, Any] | None = None,
    model: WorldModel | str | os.PathLike[str] | None = None,
    learn_reward: bool = False,
    learn_termination: bool = False,
    bad_observations: BadObservations = "raise",
    env: gym.Env[Any, Any] | None = None,
) -> WorldModel:
    """Learn a model from data, in their order: the same as `ModelLearner` learns online, to the last byte of its file.

    Parameters
    ----------
    data
        A `relgym.data.Dataset`, a Minari data set or its id, or a list: of episodes (records or dicts), or of
        transitions (`Transition`, or what `relgym.wrappers.sb3.TransitionRecorder.take` returns).
    view, targets, config, model, learn_reward, learn_termination
        As of `relgym.wrappers.ModelLearner`.
    bad_observations, env
        As of `DataLearner`.

    Returns
    -------
    The model; `model` itself if one was given. ``model.save(path)`` writes a file to dream from.

    Raises
    ------
    DataError, ConfigError
        As of `DataLearner`; nothing was learned.

    Examples
    --------
    >>> import numpy as np, relgym
    >>> x, a = np.linspace(-3.0, 3.0, 40)[:, None], np.tile([[0.5], [-1.0]], (20, 1))
    >>> data = relgym.Dataset.from_arrays(x, a, 0.9 * x + a, shuffled=True)
    >>> relgym.fit(data).modes("self", "x")[0].formula()
    "x' = 0.9 x + action.a"
    """
    if (transitions := _listed(data)) is not None:
        if view is not None or env is not None or learn_reward or learn_termination:
            raise ConfigError(
                "these data are transitions between scenes already: leave out view, env, learn_reward and "
                "learn_termination"
            )
        return _of_transitions(transitions, targets, config, model).fit(transitions)
    learner = DataLearner(
        data,
        view=view,
        targets=targets,
        config=config,
        model=model,
        learn_reward=learn_reward,
        learn_termination=learn_termination,
        bad_observations=bad_observations,
        env=env,
    )
    return learner.run().model


@refusing(ConfigError)
def progressive(
    data: Any,
    *,
    every: int = 1,
    view: ViewLike = None,
    targets: Sequence[PlainTarget] | None = None,
    config: ModelConfig | Mapping[str, Any] | None = None,
    model: WorldModel | str | os.PathLike[str] | None = None,
    learn_reward: bool = False,
    learn_termination: bool = False,
    bad_observations: BadObservations = "raise",
    env: gym.Env[Any, Any] | None = None,
) -> Iterator[Progress]:
    """Learn as `fit` does, and report how each step was predicted before it was learned from.

    As river's ``evaluate.iter_progressive_val_score``: what is measured was never seen before.

    Parameters
    ----------
    data, view, targets, config, model, learn_reward, learn_termination, bad_observations, env
        As of `fit`; data are no transitions here, `WorldModel.progressive` takes those.
    every
        A report after so many steps, and one of what remains.

    Examples
    --------
    >>> import numpy as np, relgym
    >>> x, a = np.linspace(-3.0, 3.0, 60)[:, None], np.tile([[0.5], [-1.0]], (30, 1))
    >>> data = relgym.Dataset.from_arrays(x, a, 0.9 * x + a, shuffled=True)
    >>> [(now.steps, now.score.right) for now in relgym.progressive(data, every=30)][-1]
    (60, 1.0)
    """
    checked_count("every", every, 1, 10**9)
    learner = DataLearner(
        data,
        view=view,
        targets=targets,
        config=config,
        model=model,
        learn_reward=learn_reward,
        learn_termination=learn_termination,
        bad_observations=bad_observations,
        env=env,
    )
    return _progress(learner, every)


@refusing(ConfigError)
def score(
    model: WorldModel,
    data: Any,
    *,
    view: ViewLike = None,
    bad_observations: BadObservations = "raise",
    env: gym.Env[Any, Any] | None = None,
) -> Score:
    """How well a model predicts data that it hasn't learned from: RMSE, R², share right, share abstained.

    Parameters
    ----------
    model
        Stays as it is.
    data
        As of `fit`.
    view
        The view it was learned through. Default: what the model remembers of it; a view made of functions has to be
        passed again.
    bad_observations, env
        As of `DataLearner`.

    Raises
    ------
    DataError, ConfigError
        As of `DataLearner`.
    """
    if not isinstance(model, WorldModel):
        raise ConfigError(
            f"model={model!r}: expected a WorldModel; WorldModel.load(path) reads one from a file"
        )
    if (transitions := _listed(data)) is not None:
        return model.score(transitions)
    dataset = _dataset(data, env)
    chosen = _view_of(model, dataset, view)
    return scored(model, _transitions(chosen, dataset, model, bad_observations), chosen.precision)


def _progress(learner: DataLearner, every: int) -> Iterator[Progress]:
    total, steps, latest = Score(), 0, None
    for report in learner:
        if report.prediction is None or report.transition is None:
            continue
        total.add(report.prediction, report.transition, learner.view.precision)
        steps, latest = steps + 1, report
        if steps % every == 0:
            yield Progress(steps, total, report)
            total, latest = Score(), None
    if latest is not None:
        yield Progress(steps, total, latest)


def _listed(data: Any) -> list[Any] | None:
    """The data as a list where they are transitions."""
    if isinstance(data, (Dataset, str, Mapping)) or not isinstance(data, Sequence) or not len(data):
        return None
    return list(data) if isinstance(getattr(data[0], "transition", data[0]), Transition) else None


def _of_transitions(
    transitions: Sequence[Any],
    targets: Sequence[PlainTarget] | None,
    config: ModelConfig | Mapping[str, Any] | None,
    model: WorldModel | str | os.PathLike[str] | None,
) -> WorldModel:
    if model is None:
        schema = getattr(transitions[0], "transition", transitions[0]).before.schema
        return WorldModel(schema, config, targets=targets_of(targets))
    if targets is not None or config is not None:
        raise ConfigError("a model keeps its targets and config: pass either model or those")
    return model if isinstance(model, WorldModel) else WorldModel.load(model)


def _dataset(data: Any, env: gym.Env[Any, Any] | None) -> Dataset:
    if isinstance(data, Dataset):
        if env is not None:
            raise ConfigError("a Dataset knows its spaces and objects: leave out env")
        return data
    if isinstance(data, str) or hasattr(data, "iterate_episodes"):
        return Dataset.from_minari(data, env=env)
    if isinstance(data, Iterable) and not isinstance(data, (bytes, Mapping)):
        return Dataset.from_episodes(data, env=env)
    raise DataError(
        f"expected a Dataset, a Minari data set or its id, episodes or transitions, got {type(data).__name__}; "
        "Dataset.from_arrays makes one of arrays"
    )


def _view_of(model: WorldModel, dataset: Dataset, given: ViewLike) -> View:
    """The view that a model was learned through."""
    if given is None and "view" in model.extra:
        return view_from_json(model.extra["view"])
    shown = model.schema.type_of(TASK).properties if TASK in model.schema.order else ()
    view = chosen_view(given, dataset.observation_space, dataset.action_space, schema=dataset.schema)
    if not shown or isinstance(view, TaskView):
        return view
    return TaskView(view, reward="reward" in shown, terminated="terminated" in shown)


def _step(episode: Episode, k: int, action: Any) -> Step:
    return Step(
        action, episode.observations[k + 1], episode.info(k + 1), episode.reward(k), episode.terminates(k)
    )


def _transitions(
    view: View, dataset: Dataset, model: WorldModel | None, bad: BadObservations
) -> Iterator[Transition]:
    """What happened, as transitions; rows without names are matched with what the model predicts, if there is one."""
    follower = Follower(view, bad)
    for number, episode in enumerate(dataset):
        place = f"episode {number}, observation 0"
        try:
            follower.begin(episode.observations[0], episode.info(0))
            for k, action in enumerate(episode.actions):
                place = f"episode {number}, observation {k + 1}"
                before = follower.act(readable(dataset.action_space, action))
                asked = model is not None and view.matches and before is not None
                prediction = (
                    model.predict_one(before) if asked and model is not None and before is not None else None
                )
                step = _step(episode, k, action)
                transition = follower.follow(
                    before,
                    prediction,
                    step.observation,
                    step.info,
                    reward=step.reward,
                    terminated=step.terminated,
                )
                if transition is not None:
                    yield transition
        except ObservationError as error:
            raise DataError(
                f"{place}: {error.__cause__ or error}; nothing was learned: mend the data, or leave out what can't be "
                "read with bad_observations='skip'"
            ) from error
