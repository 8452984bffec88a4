"""The home worlds' own account of what happened, for a model that was learned in one of them.

Their test sets (`relgym.experiments.data`) know of every transition which law truly held, from the engine's contact log
or the layout that was drawn. An env that was made with other arguments than those sets have is tested without.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from relgym.envs.model_files import schema_like
from relgym.errors import ConfigError
from relgym.experiments.analytic import AnalyticModes
from relgym.experiments.data import BallExperiment, ball_episodes, truck_episodes
from relgym.experiments.episodes import Episode
from relgym.scene.schema import SceneSchema

__all__ = ["TrueEpisodes", "true_episodes"]


@dataclass(frozen=True, slots=True)
class TrueEpisodes:
    """Fresh episodes of a home world, with the truth about each step.

    Attributes
    ----------
    episodes
        From how many to the episodes.
    laws
        The ball world's linear laws; None for the truck's.
    steps
        Length of an episode.
    scenes
        What is special about them, for people.
    """

    episodes: Callable[[int], Iterator[Episode]]
    laws: AnalyticModes | None
    steps: int
    scenes: str


def true_episodes(
    env_id: str, arguments: Mapping[str, Any], schema: SceneSchema, *, seed: int
) -> TrueEpisodes | None:
    """The test set of an env; None for envs of others, and arguments that it doesn't cover.

    Parameters
    ----------
    env_id, arguments
        What the env was made of.
    schema
        The model's, which must be able to speak of the set's scenes.
    seed
        Of the scenes.
    """
    make = _MAKERS.get(env_id)
    try:
        found = None if make is None else make(dict(arguments), seed)
        if found is not None:
            schema_like(next(found.episodes(1)).schema, schema, env_id)
    except (ConfigError, TypeError, ValueError):
        return None
    return found


def _ball(arguments: dict[str, Any], seed: int) -> TrueEpisodes | None:
    number = {name: arguments.pop(name, usual) for name, usual in _BALL.items()}
    kinds = tuple(arguments.pop("objects", ("box", "ramp")))
    type_names = arguments.pop("type_names", "shape")
    if arguments or not all(isinstance(value, (int, float)) for value in number.values()):
        return None
    setting = BallExperiment(
        float(number["incline"]),
        float(number["elasticity"]),
        (float(number["friction"]),),
        episodes=1,
        type_names=type_names,
        objects=kinds,
    )

    def episodes(count: int) -> Iterator[Episode]:
        return ball_episodes(setting, seed=seed, episodes=count, test=True)

    return TrueEpisodes(episodes, setting.modes(), 200, "every room in turn")


def _truck(arguments: dict[str, Any], seed: int) -> TrueEpisodes | None:
    resample, boxes = arguments.pop("resample", "episode"), arguments.pop("n_boxes", 3)
    task = arguments.pop("task", "auto")
    if arguments or (task is not None and (task, resample) != ("auto", "step")):
        return None

    def episodes(count: int) -> Iterator[Episode]:
        found = truck_episodes(resample, seed=seed, n_boxes=boxes, repeats=count, test=True)
        return (episode for episode, _ in zip(found, range(count), strict=False))

    return TrueEpisodes(episodes, None, 40, "every order of the boxes; pushed so hard that nothing stops")


_BALL = {"incline": 30.0, "elasticity": 0.9, "friction": 0.0}
_MAKERS: dict[str, Callable[[dict[str, Any], int], TrueEpisodes | None]] = {
    "relgym/BallBoxRamp-v0": _ball,
    "relgym/TruckPush-v0": _truck,
}
