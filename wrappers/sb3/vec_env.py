"""Gymnasium's vector envs as Stable-Baselines3's: its algorithms train in thousands of dreams at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from relgym.errors import ConfigError
from relgym.wrappers.dyna.keys import check_keys

__all__ = ["VectorAsVecEnv"]


class VectorAsVecEnv(VecEnv):  # type: ignore[misc]
    """A Gymnasium vector env in the form that Stable-Baselines3 asks for.

    Both step many envs at once; they differ in what happens at an episode's end. Here an env that is over begins anew
    in the same step, ``infos[i]["terminal_observation"]`` holds its last observation and
    ``infos[i]["TimeLimit.truncated"]`` says whether it was cut off, so that values are bootstrapped from it.

    Parameters
    ----------
    envs
        A vector env with ``AutoresetMode.SAME_STEP``: a `LearnedModelVectorEnv`, say, or what ``gym.make_vec`` made,
        possibly in vector wrappers.

    Raises
    ------
    ConfigError
        Not a vector env, one with another autoreset mode, or a Dict with a dot in a key.

    Notes
    -----
    Infos are dictionaries, one per env: those of envs to which nothing happened are empty. `get_attr` asks the vector
    env and repeats the answer; `env_method` calls it once. Seeds: `seed(s)` seeds the whole at the next reset.

    Examples
    --------
    >>> from stable_baselines3 import PPO  # doctest: +SKIP
    >>> dreams = LearnedModelVectorEnv("truck.json", 64, autoreset_mode="SameStep")  # doctest: +SKIP
    >>> agent = PPO("MultiInputPolicy", VectorAsVecEnv(dreams)).learn(100_000)  # doctest: +SKIP
    """

    def __init__(self, envs: VectorEnv[Any, Any, Any]) -> None:
        if not isinstance(envs, VectorEnv):
            raise ConfigError(
                f"expected a Gymnasium vector env, got {envs!r}; gym.make_vec makes one of an id"
            )
        if envs.metadata.get("autoreset_mode") is not AutoresetMode.SAME_STEP:
            raise ConfigError(
                f"{envs} has autoreset_mode={envs.metadata.get('autoreset_mode')}, but Stable-Baselines3 expects that "
                "an env that is over begins anew in the same step: make it with "
                "autoreset_mode=AutoresetMode.SAME_STEP"
            )
        check_keys(envs.single_observation_space)
        self.envs = envs
        self._actions: NDArray[Any] | None = None
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self.metadata = envs.metadata

    # ------------------------------------------------------------------ stepping
    def reset(self) -> Any:
        """Begin all episodes; seed and options of the first env hold for all, and only once."""
        options = self._options[0] if self._options and self._options[0] else None
        observations, infos = self.envs.reset(seed=self._seeds[0], options=options)
        self.reset_infos = self._listed(infos)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take up the next actions."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Step, and begin anew what is over."""
        assert self._actions is not None, "step_async comes first"
        observations, rewards, terminated, truncated, infos = self.envs.step(self._actions)
        over = terminated | truncated
        told = self._listed(infos)
        if over.any():
            final = self._listed(infos.get("final_info", {}))
            for k in np.flatnonzero(over).tolist():
                self.reset_infos[k] = told[k]
                told[k] = {
                    **final[k],
                    "terminal_observation": infos["final_obs"][k],
                    "TimeLimit.truncated": bool(truncated[k] and not terminated[k]),
                }
        return observations, rewards.astype(np.float32), over, told

    def close(self) -> None:
        """Close the vector env."""
        self.envs.close()

    def get_images(self) -> Sequence[Any]:
        """Pictures of all envs."""
        return tuple(self.envs.render() or ())

    # ------------------------------------------------------------------ what SB3 asks of single envs
    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the vector env, once for each env that is asked."""
        value = self.envs.render_mode if attr_name == "render_mode" else self._found(attr_name)
        return [value for _ in self._numbers(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the vector env; `ConfigError` unless for all envs at once."""
        if len(list(self._numbers(indices))) != self.num_envs:
            raise ConfigError(
                f"{attr_name} can only be set for all {self.num_envs} envs: they are one object"
            )
        setattr(self.envs.unwrapped, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the vector env, once; the answer is repeated for each env that is asked."""
        value = self._found(method_name)(*args, **kwargs)
        return [value for _ in self._numbers(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Whether a vector wrapper of this class is around the envs."""
        around, found = self.envs, False
        while not found and around is not around.unwrapped:
            found, around = isinstance(around, wrapper_class), around.env  # type: ignore[attr-defined]
        return [found for _ in self._numbers(indices)]

    # ------------------------------------------------------------------ helpers
    def _numbers(self, indices: Any) -> Iterable[int]:
        numbers: Iterable[int] = self._get_indices(indices)
        return numbers

    def _found(self, name: str) -> Any:
        """An attribute of the vector env or of what it wraps."""
        return getattr(self.envs, name) if hasattr(self.envs, name) else getattr(self.envs.unwrapped, name)

    def _listed(self, infos: dict[str, Any]) -> list[dict[str, Any]]:
        """Infos by env; only what is marked as an env's own."""
        told: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for name, values in infos.items():
            if name.startswith("_") or name.startswith("final_") or f"_{name}" not in infos:
                continue
            for k in np.flatnonzero(infos[f"_{name}"]).tolist():
                told[k][name] = _one(values, k)
        return told


def _one(values: Any, k: int) -> Any:
    """What the infos say of one env: an element, or a dictionary of elements."""
    if isinstance(values, dict):
        return {name: _one(part, k) for name, part in values.items() if not name.startswith("_")}
    value = values[k]
    return value.item() if isinstance(value, np.generic) else value
