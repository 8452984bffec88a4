"""Short, relative, scaled float32 vectors instead of Dict observations: what policy networks learn well from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from relgym.envs.arguments import refuse_vector_env
from relgym.envs.flat import FlatSpec, Flattener
from relgym.errors import ConfigError
from relgym.wrappers.views import SceneView, view_of

__all__ = ["FlatView"]


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
    >>> env = FlatView(gym.make("relgym/TruckPush-v0", task="push"))
    >>> env.observation_space.shape
    (15,)
    >>> env.flattener.names[:5]
    ('truck.vx/5', 'box1.px/10', 'box1.py/5', 'box1.pz/10', 'box1.friction/0.25')
    """

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
