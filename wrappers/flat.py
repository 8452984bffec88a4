"""Short, relative, scaled float32 vectors instead of Dict observations: what policy networks learn well from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from relgym.arguments import refusing
from relgym.envs.arguments import refuse_vector_env, stepped
from relgym.envs.flat import FlatSpec, Flattener
from relgym.errors import ConfigError
from relgym.scene.schema import SceneSchema
from relgym.wrappers.views import SceneView, view_of

__all__ = ["FlatView", "VectorFlatView"]


class FlatView(gym.ObservationWrapper[NDArray[np.float32], Any, Any], RecordConstructorArgs):
    """Shows scenes as flat vectors: relative to the actor, scaled, padded and masked.

    Goes round a `relgym.envs.SceneEnv`, a dream of it or a `ModelLearner` around it; learners belong inside.

    Parameters
    ----------
    env
        An env whose observations are scenes.
    spec
        What to show. Default: what the env itself declares as ``flat_spec``; and if it declares nothing, all
        properties as they are. A dream made `like` a real env shows what that shows; one of a file alone has to be
        told.

    Attributes
    ----------
    flattener : Flattener
        The function from scenes to vectors, for any number of scenes at once; ``flattener.names`` says what each
        element is.

    Raises
    ------
    ConfigError
        An env without scenes, or a spec that doesn't fit its schema.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> env = FlatView(gym.make("relgym/TruckPush-v0"))
    >>> env.observation_space.shape
    (15,)
    >>> env.flattener.names[:5]
    ('truck.vx/5', 'box1.px/10', 'box1.py/5', 'box1.pz/10', 'box1.friction/0.25')
    """

    @refusing(ConfigError)
    def __init__(self, env: gym.Env[Any, Any], spec: FlatSpec | None = None) -> None:
        refuse_vector_env(env)
        RecordConstructorArgs.__init__(self, spec=spec)
        gym.ObservationWrapper.__init__(self, env)
        if spec is None and env.has_wrapper_attr("flat_spec"):
            spec = env.get_wrapper_attr("flat_spec")
        view = view_of(env)
        if not isinstance(view, SceneView):
            raise ConfigError(
                f"{env} has no `schema`: expected an env whose observations are scenes (relgym.envs.SceneEnv); "
                "observations that are numbers need no flattening, or gymnasium.wrappers.FlattenObservation"
            )
        self._schema = view.schema
        self.flattener = Flattener(self._schema, spec or FlatSpec())
        self.observation_space = self.flattener.space

    def observation(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        """The flat vector of one observation, shape ``(len(flattener.names),)``."""
        scene = self._schema.scene(observation)
        flat: NDArray[np.float32] = self.flattener(scene.layout, scene.vector[None])[0]
        return flat


class VectorFlatView(gym.vector.VectorWrapper[Any, Any, Any, Any, Any], RecordConstructorArgs):
    """Shows the scenes of a vector env as flat vectors, of all envs at once: `FlatView` for dreams by the thousand.

    Last observations that a ``SAME_STEP`` autoreset puts into ``infos["final_obs"]`` become flat as well.

    Parameters
    ----------
    env
        A vector env whose envs' observations are scenes: of `relgym.envs.SceneEnv`, or `LearnedModelVectorEnv`.
    spec
        What to show; see `FlatView`.

    Attributes
    ----------
    flattener : Flattener
        The function from scenes to vectors.

    Raises
    ------
    ConfigError
        A single env, envs without scenes, or a spec that doesn't fit their schema.

    Examples
    --------
    >>> import gymnasium as gym, relgym
    >>> envs = VectorFlatView(gym.make_vec("relgym/TruckPush-v0", 3, vectorization_mode="sync"))
    >>> flat, _ = envs.reset(seed=0)
    >>> flat.shape
    (3, 15)
    """

    @refusing(ConfigError)
    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any], spec: FlatSpec | None = None) -> None:
        RecordConstructorArgs.__init__(self, spec=spec)
        gym.vector.VectorWrapper.__init__(self, env)
        self._schema: SceneSchema | None = _shared(env, "schema")
        if self._schema is None:
            raise ConfigError(
                f"{env} has no `schema`: expected a vector env whose observations are scenes (of relgym.envs.SceneEnv)"
            )
        self.flattener = Flattener(self._schema, spec or _shared(env, "flat_spec") or FlatSpec())
        self.single_observation_space = self.flattener.space
        self.observation_space = batch_space(self.flattener.space, self.num_envs)

    @refusing(ConfigError)
    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin episodes; flat observations, shape ``(num_envs, len(flattener.names))``."""
        observations, infos = self.env.reset(seed=None if seed is None else int(seed), options=options)
        return self._flat(observations), infos

    def step(self, actions: Any) -> tuple[NDArray[np.float32], Any, Any, Any, dict[str, Any]]:
        """Step all envs; see `reset` for the observations."""
        observations, rewards, terminated, truncated, infos = stepped(self.env, actions)
        if "final_obs" in infos:
            final = np.full(self.num_envs, None, dtype=object)
            for k in np.flatnonzero(infos["_final_obs"]).tolist():
                final[k] = self._flat({name: v[None] for name, v in infos["final_obs"][k].items()})[0]
            infos = {**infos, "final_obs": final}
        return self._flat(observations), rewards, terminated, truncated, infos

    def _flat(self, observations: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float32]:
        assert self._schema is not None, "checked when made"
        layout = self._schema.layout(observations)
        vectors = np.concatenate([observations[name] for name in layout.names], axis=1)
        return self.flattener(layout, np.asarray(vectors, dtype=np.float64))


def _shared(env: gym.vector.VectorEnv[Any, Any, Any], name: str) -> Any:
    """An attribute of the vector env itself, or of its envs; None where there is none."""
    inner: Any = env.unwrapped
    if hasattr(inner, name) or not hasattr(inner, "call"):
        return getattr(inner, name, None)
    return inner.get_attr(name)[0] if inner.call("has_wrapper_attr", name)[0] else None
