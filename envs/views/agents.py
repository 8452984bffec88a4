"""The view of envs of several agents: each agent is an object, and what it does is a property of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from relgym.envs.agents import AgentsSpace
from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.envs.views.acts import Acts
from relgym.envs.views.arrangement import numbered
from relgym.envs.views.base import precision_of
from relgym.envs.views.leaves import Numbers
from relgym.envs.views.records import identifiers
from relgym.errors import ConfigError, ObservationError
from relgym.scene.objects import ObjectType, Scene
from relgym.scene.schema import SceneSchema

__all__ = ["AgentsView"]


class AgentsView:
    """Agents as objects; those of a kind are of one type, so that what is learned of one holds for all.

    What an agent sees and what it does are its properties; it may be absent. Without bodies they stand in no spatial
    relation, but functions may use properties of other agents.

    Parameters
    ----------
    observation_space, action_space
        Of an `AgentsEnv`: a part for each agent, flat or one level of Dict or Tuple of flat spaces.
    kinds
        Kind of each agent, by name. Default: its name without the number behind it, as PettingZoo calls agents;
        agents of a kind whose spaces differ are kinds of their own.
    names
        Names of the numbers that agents of a kind see, by kind (default ``x0``, ``x1``, …).
    actions
        Names of actions, by kind: see `Acts`.

    Raises
    ------
    ConfigError
        Spaces that aren't by agent, or that can't be viewed so; names that don't fit.

    Examples
    --------
    >>> seen = AgentsSpace({f"runner_{k}": spaces.Box(-9, 9, (2,), np.float64) for k in range(2)})
    >>> done = AgentsSpace({f"runner_{k}": spaces.Box(-1, 1, (1,), np.float64) for k in range(2)})
    >>> view = AgentsView(seen, done, names={"runner": ("x", "v")})
    >>> scene = view.scene({"runner_1": np.array([3.0, 0.5])})
    >>> view.with_action(scene, {"runner_1": np.array([0.25])})["runner_1"].values
    array([3.  , 0.5 , 0.25])
    >>> scene["runner_1"].type.name, scene.layout.names
    ('runner', ('runner_1',))
    """

    matches = False

    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        kinds: Mapping[str, str] | None = None,
        names: Mapping[str, Sequence[str]] | None = None,
        actions: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        self._spaces = (_by_agent(observation_space), _by_agent(action_space))
        if self._spaces[0].spaces.keys() != self._spaces[1].spaces.keys():
            raise ConfigError(
                f"expected observations and actions of the same agents, got {list(self._spaces[0])} and "
                f"{list(self._spaces[1])}"
            )
        agents = tuple(self._spaces[0].spaces)
        if wrong := [agent for agent in agents if not agent.isidentifier()]:
            raise ConfigError(f"names of agents must be Python identifiers, such as 'runner_0', got {wrong}")
        self.kinds = self._kinds(agents, kinds)
        for what, given in (("names", names), ("actions", actions)):
            if unknown := sorted(set(given or ()) - set(self.kinds.values())):
                raise ConfigError(
                    f"{what}: no agents are of kinds {unknown}; there are {sorted(set(self.kinds.values()))}"
                )
        self._names = {kind: tuple(given) for kind, given in (names or {}).items()}
        self._actions = {kind: tuple(given) for kind, given in (actions or {}).items()}
        self._numbers: dict[str, Numbers] = {}
        self._acts: dict[str, Acts] = {}
        types: dict[str, ObjectType] = {}
        for agent, kind in self.kinds.items():
            if kind not in types:
                self._numbers[kind] = Numbers(self._spaces[0][agent])
                self._acts[kind] = Acts(self._spaces[1][agent], self._actions.get(kind))
                types[kind] = self._type(kind)
        self.schema = SceneSchema(tuple(types.values()), tuple(self.kinds.items()))

    def _kinds(self, agents: Sequence[str], given: Mapping[str, str] | None) -> dict[str, str]:
        """Kind of each agent."""
        if given is not None:
            if set(given) != set(agents):
                raise ConfigError(f"kinds: expected a kind for each of {list(agents)}, got {dict(given)}")
            found = {agent: given[agent] for agent in agents}
        else:
            found = {agent: _stem(agent) for agent in agents}
        first = {kind: agent for agent, kind in reversed(found.items())}
        differ = {
            kind
            for agent, kind in found.items()
            if any(space[agent] != space[first[kind]] for space in self._spaces)
        }
        if differ and given is not None:
            raise ConfigError(
                f"kinds: agents of the kinds {sorted(differ)} see or do different things; name them apart"
            )
        return {agent: agent if kind in differ else kind for agent, kind in found.items()}

    def _type(self, kind: str) -> ObjectType:
        numbers, acts = self._numbers[kind], self._acts[kind]
        seen = self._names.get(kind, _default_names(numbers))
        identifiers(f"names of what {kind!r} sees", seen, numbers.width)
        if twice := sorted(set(seen) & set(acts.properties)):
            raise ConfigError(
                f"{kind!r}: {twice} name both what it sees and what it does; pass names= or actions="
            )
        return ObjectType(
            kind, (*seen, *acts.properties), exogenous=acts.properties, optional=True, flags=acts.type.flags
        )

    @property
    def precision(self) -> float:
        """Relative precision of the numbers that it shows: see `View`."""
        return precision_of(*(single for numbers in self._numbers.values() for single in numbers.single))

    def scene(
        self,
        observation: Any,
        info: Mapping[str, Any] | None = None,
        *,
        last: Scene | None = None,
        expected: Scene | None = None,
    ) -> Scene:
        """The scene that an observation shows, in which nobody acts; see `View.scene`."""
        if not isinstance(observation, Mapping):
            raise ObservationError(f"expected an observation by agent, got {type(observation).__name__}")
        if unknown := [agent for agent in observation if agent not in self.kinds]:
            raise ObservationError(f"unknown agents {unknown}; there are {list(self.kinds)}")
        found = {}
        for agent, seen in observation.items():
            kind = self.kinds[agent]
            try:
                numbers = self._numbers[kind].read(seen)
            except ObservationError as error:
                raise ObservationError(f"agent {agent!r}: {error}") from None
            found[agent] = np.concatenate([numbers, np.zeros(len(self._acts[kind].properties))])
        return self.schema.scene(found)

    def check_actions(self, space: spaces.Space[Any]) -> None:
        """Raise `ConfigError` unless the view can read actions of a space."""
        if not isinstance(space, spaces.Dict) or space.spaces.keys() != self.kinds.keys():
            raise ConfigError(
                f"the view was made for actions of {list(self.kinds)}, but the action space is {space}"
            )
        for agent, kind in self.kinds.items():
            self._acts[kind].check(space[agent])

    def with_action(self, scene: Scene, action: Mapping[str, Any]) -> Scene:
        """The scene in which agents do this; what is said of agents that aren't there is left out."""
        vector, layout = scene.vector.copy(), scene.layout
        for index, agent in enumerate(layout.names):
            kind = self.kinds.get(agent)
            if kind is None:  # the task
                continue
            cut = layout.slice(index)
            values = self._acts[kind].values(action[agent]) if agent in action else 0.0
            vector[cut.start + self._numbers[kind].width : cut.stop] = values
        return Scene(scene.schema, layout, vector)

    def with_outcome(self, scene: Scene, reward: Any, terminated: bool) -> Scene:
        """The scene as it is: this view learns of the agents alone (`TaskView` of more)."""
        return scene

    def observation(self, scene: Scene) -> dict[str, Any]:
        """The observation that shows a scene."""
        found = {}
        for o in scene:
            if (kind := self.kinds.get(o.name)) is not None:
                numbers = self._numbers[kind]
                found[o.name] = numbers.write(o.values[: numbers.width])
        return found

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {
            "kind": "agents",
            "observation": space_to_json(self._spaces[0]),
            "action": space_to_json(self._spaces[1]),
            "kinds": dict(self.kinds),
            "names": {kind: list(names) for kind, names in self._names.items()},
            "actions": {kind: list(names) for kind, names in self._actions.items()},
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> AgentsView:
        """Read what `to_json` wrote."""
        return cls(
            space_from_json(data["observation"]),
            space_from_json(data["action"]),
            kinds=data["kinds"],
            names=data["names"],
            actions=data["actions"],
        )


def _by_agent(space: spaces.Space[Any]) -> AgentsSpace:
    if not isinstance(space, spaces.Dict):
        raise ConfigError(f"expected a Dict space with a part for each agent, got {space}")
    return space if isinstance(space, AgentsSpace) else AgentsSpace(space.spaces)


def _stem(agent: str) -> str:
    """The name without the number behind it: ``runner`` of ``runner_0``."""
    stem, line, number = agent.rpartition("_")
    return stem if line and stem and number.isdecimal() else agent


def _default_names(numbers: Numbers) -> tuple[str, ...]:
    """``x0``, ``x1``, …; with the key before them where there are several parts."""
    if numbers.leaves[0].key is None:
        return numbered(numbers.width)
    return tuple(f"{_word(leaf.key)}_{name}" for leaf in numbers.leaves for name in numbered(leaf.size))


def _word(key: Any) -> str:
    return str(key) if str(key).isidentifier() else f"part{key}"
