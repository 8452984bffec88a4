"""The wrapper that learns one model from all envs of a vector env."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import iterate
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.config import ModelConfig
from relgym.envs.arguments import stepped
from relgym.envs.model_files import made_how
from relgym.errors import ConfigError
from relgym.model.protocol import SceneLearner
from relgym.wrappers.follower import BadObservations
from relgym.wrappers.learning import Learning
from relgym.wrappers.observer import First, Observer, Step
from relgym.wrappers.settings import PlainTarget
from relgym.wrappers.study import NOTHING
from relgym.wrappers.views import ViewLike, chosen_view, readable

__all__ = ["VectorModelLearner", "info_at"]


class VectorModelLearner(Learning, gym.vector.VectorWrapper[Any, Any, Any, Any, Any]):
    """Learns one `WorldModel` from n envs at once; what they return stays as it is.

    The envs' transitions are taken up one after the other, in their order, as if one env had made them all: predict,
    compare, learn. Never learned are pseudo-transitions, from the end of an episode to the beginning of the next:
    with ``NEXT_STEP`` autoreset the step that resets is left out; with ``SAME_STEP`` the transition leads to
    ``info["final_obs"]``; with ``DISABLED`` the caller resets (``reset(options={"reset_mask": mask})``).

    ``info["relgym"]`` holds a `StepReport` for each env, in an array of shape ``(num_envs,)``.

    Parameters
    ----------
    env
        A vector env that declares its ``metadata["autoreset_mode"]``.
    view, targets, config, learn, predict, learn_reward, learn_termination, bad_observations, background, model, window
        As of `ModelLearner`; views see single envs.

    Raises
    ------
    ConfigError
        A single env, a vector env that doesn't declare its autoreset mode, or as of `ModelLearner`.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> envs = VectorModelLearner(gym.make_vec("relgym/TruckPush-v0", 4, resample="step"), targets=["truck.vx"])
    >>> _ = envs.reset(seed=0)
    >>> *_, info = envs.step(envs.action_space.sample())
    >>> envs.model
    WorldModel(truck.vx: 0 modes; 4 transitions)
    """

    @refusing(ConfigError)
    def __init__(
        self,
        env: gym.vector.VectorEnv[Any, Any, Any],
        *,
        view: ViewLike = None,
        targets: Sequence[PlainTarget] | None = None,
        config: ModelConfig | Mapping[str, Any] | None = None,
        learn: bool = True,
        predict: bool = True,
        learn_reward: bool = False,
        learn_termination: bool = False,
        bad_observations: BadObservations = "raise",
        background: int | None = None,
        model: SceneLearner | str | os.PathLike[str] | None = None,
        window: int = 1000,
    ) -> None:
        if not isinstance(env, gym.vector.VectorEnv):
            raise ConfigError(f"expected a vector env, got {env}: ModelLearner(env) learns from a single one")
        super().__init__(env)
        self._mode = _autoreset_mode(env)
        spaces_of = (env.single_observation_space, env.single_action_space)
        chosen = chosen_view(
            view, *spaces_of, schema=_schema(env), reward=learn_reward, terminated=learn_termination
        )
        self._observer = Observer(
            chosen,
            *spaces_of,
            envs=env.num_envs,
            targets=targets,
            config=config,
            model=model,
            learn=learn,
            predict=predict,
            window=window,
            background=background,
            bad_observations=bad_observations,
            metadata=made_how(env.spec),
        )

    # ------------------------------------------------------------------ the Gymnasium contract
    @refusing(ConfigError)
    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes: in all envs, or in those of ``options["reset_mask"]``."""
        given: Any = seed
        if isinstance(given, np.integer):  # Gymnasium takes Python's own alone
            given = int(given)
        if isinstance(seed, Sequence) and len(seed) != self.num_envs:
            raise ConfigError(
                f"seed: expected a number, or one for each of {self.num_envs} envs, got {len(seed)}"
            )
        mask = (options or {}).get("reset_mask")
        begun = range(self.num_envs) if mask is None else np.flatnonzero(mask).tolist()
        for number in begun:
            self._observer.followers[number].forget()
        observations, infos = self.env.reset(seed=given, options=options)
        seen = self._single(observations)
        self._observer.begin({k: (seen[k], info_at(infos, k)) for k in begun})
        return observations, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step all envs, then predict and learn, one env after the other.

        Actions outside their space are treated as in `ModelLearner.step`.

        Raises
        ------
        ObservationError
            An observation is no scene, and such aren't skipped; the message says whose. The envs have stepped, the
            model is unchanged; `reset` begins anew.
        """
        observer, count = self._observer, self.num_envs
        given = [readable(self.single_action_space, action) for action in self._actions(actions)]
        observations, rewards, terminated, truncated, infos = stepped(self.env, actions)
        steps: dict[int, Step] = {}
        firsts: dict[int, First] = {}
        for k, seen in enumerate(self._single(observations)):
            follower, info = observer.followers[k], info_at(infos, k)
            ended = bool(terminated[k] or truncated[k])
            resets = follower.over and self._mode is AutoresetMode.NEXT_STEP
            final = ended and not resets and self._mode is AutoresetMode.SAME_STEP
            if resets or final:
                firsts[k] = (seen, info)
            if not resets:  # such a step means nothing but that
                last = (_final(infos, k), info_at(infos.get("final_info", {}), k)) if final else (seen, info)
                steps[k] = Step(given[k], *last, rewards[k], bool(terminated[k]))
        reports: NDArray[Any] = np.full(count, NOTHING, dtype=object)
        for k, report in observer.follow_all(steps, firsts).items():
            reports[k] = report
        for k in range(count):
            observer.followers[k].over = bool(terminated[k] or truncated[k])
        return observations, rewards, terminated, truncated, {**infos, "relgym": reports}

    def close(self, **kwargs: Any) -> None:
        """Close the envs, and end the background process if there is one; as `ModelLearner.close`."""
        try:
            self._observer.close()
        finally:
            super().close(**kwargs)

    def _actions(self, actions: Any) -> list[Any]:
        """Single actions; ``None`` for all where they can't be told apart, which is for the envs to mind."""
        try:
            given = list(iterate(self.action_space, actions))
        except (TypeError, ValueError, KeyError, IndexError):
            given = []
        return given if len(given) == self.num_envs else [None] * self.num_envs

    def _single(self, observations: Any) -> list[Any]:
        return list(iterate(self.observation_space, observations))


def info_at(infos: Mapping[str, Any], k: int) -> dict[str, Any]:
    """The k-th env's part of a vector env's infos."""
    return dict(_entries(infos, k))


def _entries(infos: Mapping[str, Any], k: int) -> Iterator[tuple[str, Any]]:
    for key, values in infos.items():
        mask = infos.get(f"_{key}")
        if mask is None or not mask[k]:
            continue
        yield key, info_at(values, k) if isinstance(values, Mapping) else values[k]


def _final(infos: Mapping[str, Any], k: int) -> Any:
    final = infos["final_obs"]
    return {key: part[k] for key, part in final.items()} if isinstance(final, Mapping) else final[k]


def _autoreset_mode(env: gym.vector.VectorEnv[Any, Any, Any]) -> AutoresetMode:
    mode = env.metadata.get("autoreset_mode")
    try:
        return AutoresetMode(mode)
    except ValueError:
        raise ConfigError(
            f"{env} doesn't say how it begins new episodes: expected metadata['autoreset_mode'] to be one of "
            f"{list(AutoresetMode)}, got {mode!r}; without it the step from one episode to the next would be learned"
        ) from None


def _schema(env: gym.vector.VectorEnv[Any, Any, Any]) -> Any:
    """The envs' schema, if they have one, or whatever they call so."""
    inner: Any = env.unwrapped
    if hasattr(inner, "schema"):
        return inner.schema
    # Asked first: an attribute that isn't there would end the processes of an AsyncVectorEnv.
    if not hasattr(inner, "call") or not inner.call("has_wrapper_attr", "schema")[0]:
        return None
    return inner.get_attr("schema")[0]
