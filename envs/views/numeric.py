"""The view of envs whose observations are numbers: one object, one per key, or objects that the user names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from relgym.arguments import array_of, finite, refusing, refusing_calls
from relgym.envs.spaces_json import space_from_json, space_to_json
from relgym.envs.views.acts import Acts
from relgym.envs.views.angles import candidates, circular, decoded, disjoint, on_circle
from relgym.envs.views.arrangement import arranged, default_parts, numbered
from relgym.envs.views.base import precision_of
from relgym.envs.views.leaves import Numbers
from relgym.envs.views.records import Angle, Part, Static, identifiers
from relgym.errors import ConfigError, ObservationError
from relgym.model.percepts.scenes import scene_of
from relgym.scene.objects import Float1D, Float2D, Scene, SceneLayout

__all__ = ["NumbersView"]


@refusing_calls(ConfigError)
class NumbersView:
    """Numbers as properties of objects without bodies, or with them where the user says so.

    A flat Box, Discrete, MultiDiscrete, MultiBinary or Tuple is one object, `self`; a Dict is one object per
    key. `parts` gives numbers to other objects.

    Parameters
    ----------
    observation_space, action_space
        The env's spaces: flat, or one level of Dict or Tuple of flat ones.
    names
        Names of the numbers (default ``x0``, ``x1``, …); for a Dict those of some keys, by key. Parts and angles
        call the numbers of a Dict ``key.name``.
    parts
        Objects and the numbers that are theirs; numbers of no part stay where they are by default.
    angles
        Pairs that are (cos, sin) of an angle: names, or `Angle` records. ``"auto"`` (default): neighbours of one
        object, in [-1, 1] or unbounded, whose squares sum to 1 in the first observations (`settled`). That is a guess:
        learners take it back when a later observation refutes it (`upheld`). A pair that is given here is no guess;
        an observation that is off the circle is then a bad one.
    actions
        Names of the choices of a Discrete action, or of the numbers of another one (`Acts`).
    static
        Objects that the observation doesn't show.
    up, planar
        As in `SceneSchema`; they matter only to parts with bodies.

    Raises
    ------
    ConfigError
        Spaces that can't be viewed so, or declarations that don't fit them.

    Examples
    --------
    >>> box, push = spaces.Box(-9, 9, (2,), np.float64), spaces.Discrete(2)
    >>> view = NumbersView(box, push, names=("x", "v"))
    >>> scene = view.with_action(view.scene(np.array([1.0, 2.0])), 1)
    >>> scene["self"]["v"], scene["action"]["a"]
    (2.0, 1.0)
    >>> view.observation(scene)
    array([1., 2.])
    """

    matches = False

    @refusing(ConfigError)
    def __init__(
        self,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        names: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
        parts: Sequence[Part] = (),
        angles: Literal["auto"] | Sequence[Angle | Sequence[str]] = "auto",
        actions: Sequence[str] | None = None,
        static: Sequence[Static] = (),
        up: str = "y",
        planar: bool = True,
    ) -> None:
        self._numbers = Numbers(observation_space)
        self._acts = Acts(action_space, actions)
        self.names = _named(self._numbers, names)
        self._parts, self._static, self._axes = tuple(parts), tuple(static), (up, planar)
        if isinstance(angles, str) and angles != "auto":
            raise ConfigError(f"angles={angles!r}: expected 'auto' or pairs of names (cosine, sine)")
        self._auto = isinstance(angles, str)
        self.angles = () if isinstance(angles, str) else tuple(_angle(given) for given in angles)
        self._possible: tuple[
            tuple[int, int], ...
        ] = ()  # pairs that were guessed, or would be in place of these
        whole = default_parts(self.names, self._parts)
        self._owner = {source: part.name for part in whole for source in part.sources.values()}
        self._how = arranged(
            self.names, whole, self.angles, static, self._acts.type, self._axes, self.precision
        )
        self.schema = self._how.schema

    # ------------------------------------------------------------------ angles
    @property
    def open(self) -> bool:
        """Whether some pairs of numbers may yet turn out to be angles: see `settled`."""
        return bool(self._candidates())

    def settled(self, observations: Sequence[Any]) -> NumbersView:
        """The view with angles guessed from some first observations; itself where nothing is open.

        Those that are no observations (another length, NaN) say nothing; where all are such, the view stays open.
        """
        pairs, sound = self._candidates(), [n for o in observations if (n := self._sound(o)) is not None]
        if not pairs or not sound:
            return self
        seen: NDArray[np.float64] = np.stack(sound)
        low, high = self._numbers.bounds
        bounded, single = np.isfinite(low) & np.isfinite(high), self._numbers.single
        found = [p for p in pairs if circular(seen, p, bounded=bool(bounded[p[0]]), single=single[p[0]])]
        return self._guessing(found)

    def upheld(self, observation: Any) -> NumbersView:
        """The view without those guessed angles that an observation refutes; itself where it refutes none.

        One that is no observation at all (another length, NaN) refutes nothing.
        """
        if not self._possible:
            return self
        try:
            numbers = self._numbers.read(observation)
        except ObservationError:
            return self
        # What isn't finite is off every circle, and asked last: it is rare, and this is asked at every step.
        if all(self._turns(pair, numbers) for pair in self._how.pairs) or not np.isfinite(numbers).all():
            return self
        return self._guessing([pair for pair in self._possible if self._turns(pair, numbers)])

    def _guessing(self, possible: Sequence[tuple[int, int]]) -> NumbersView:
        """The view with angles for the first of these pairs, and as many of the others as go together."""
        angles = [[self.names[i], self.names[j], None] for i, j in disjoint(possible)]
        view = NumbersView.from_json(self.to_json() | {"angles": angles})
        view._possible = tuple(possible)
        return view

    def _sound(self, observation: Any) -> Float1D | None:
        try:
            numbers = self._numbers.read(observation)
        except ObservationError:
            return None
        return numbers if np.isfinite(numbers).all() else None

    def _turns(self, pair: tuple[int, int], numbers: Float1D) -> bool:
        cos, sin = (float(numbers[k]) for k in pair)
        return on_circle(cos, sin, single=self._numbers.single[pair[0]])

    def _candidates(self) -> tuple[tuple[int, int], ...]:
        if not self._auto:
            return ()
        pairs = candidates(*self._numbers.bounds)
        return tuple(p for p in pairs if self._owner[self.names[p[0]]] == self._owner[self.names[p[1]]])

    # ------------------------------------------------------------------ scenes
    @property
    def precision(self) -> float:
        """Relative precision of the numbers that it shows: see `View`."""
        return precision_of(*self._numbers.single)

    @refusing(ObservationError)
    def scene(
        self,
        observation: Any,
        info: Mapping[str, Any] | None = None,
        *,
        last: Scene | None = None,
        expected: Scene | None = None,
    ) -> Scene:
        """The scene that an observation shows; see `View.scene`."""
        numbers, how = self._numbers.read(observation), self._how
        if not finite(numbers):
            self._complain(numbers)
        if how.pairs or len(how.constants):
            angles = [self._decoded(pair, numbers) for pair in how.pairs]
            numbers = np.concatenate([numbers, angles, how.constants])
        return scene_of(self.schema, how.layout, numbers[how.gather])

    def check_actions(self, space: spaces.Space[Any]) -> None:
        """Raise `ConfigError` unless the view can read actions of a space."""
        self._acts.check(space)

    @refusing(ObservationError)
    def with_action(self, scene: Scene, action: Any) -> Scene:
        """The scene with the action's properties: see `Acts`."""
        return self._acts.acting(scene, action)

    def with_outcome(self, scene: Scene, reward: Any, terminated: bool) -> Scene:
        """The scene as it is: this view learns of the state alone (`TaskView` of more)."""
        return scene

    def observation(self, scene: Scene) -> Any:
        """The observation that shows a scene: the inverse of `scene`."""
        sources, width = self._sources(scene), self._numbers.width
        numbers = sources[:width]
        for (i, j), angle in zip(self._how.pairs, sources[width:], strict=False):
            numbers[i], numbers[j] = np.cos(angle), np.sin(angle)
        return self._numbers.write(numbers)

    def observations(self, layout: SceneLayout, vectors: Float2D) -> tuple[Any, NDArray[np.bool_]]:
        """`observation` of n scenes, batched, and which lie in the observation space: see `View`."""
        how, width = self._how, self._numbers.width
        vectors = array_of("vectors", vectors, (None, layout.width), ObservationError)
        columns = np.concatenate(
            [np.arange(layout.width)[layout.slice(layout.index(name))] for name in how.layout.names]
        )
        sources = np.zeros((len(vectors), width + len(how.pairs) + len(how.constants)))
        sources[:, how.gather] = vectors[:, columns]
        for k, (i, j) in enumerate(how.pairs):
            angle = sources[:, width + k]
            sources[:, i], sources[:, j] = np.cos(angle), np.sin(angle)
        return self._numbers.write_all(sources[:, :width])

    def action_values(self, actions: Any) -> Float2D:
        """Properties of the action object for n actions: see `View`."""
        return self._acts.values_batch(actions)

    def _sources(self, scene: Scene) -> Float1D:
        """Numbers, angles and constants of a scene: what its vector was gathered from."""
        how = self._how
        if scene.layout.names == how.layout.names:
            vector = scene.vector
        else:
            vector = np.concatenate([scene[name].values for name in how.layout.names])
        sources = np.zeros(self._numbers.width + len(how.pairs) + len(how.constants))
        sources[how.gather] = vector
        return sources

    def _decoded(self, pair: tuple[int, int], numbers: Float1D) -> float:
        i, j = pair
        if not self._turns(pair, numbers):
            raise ObservationError(
                f"{self.names[i]!r} and {self.names[j]!r} were taken for cosine and sine of an angle, but now they are "
                f"{numbers[i]:g} and {numbers[j]:g}; say which pairs are angles, "
                "view=NumbersView(..., angles=()) if none is"
            )
        return decoded(float(numbers[i]), float(numbers[j]), single=self._numbers.single[i])

    def _complain(self, numbers: Float1D) -> None:
        k = int(np.flatnonzero(~np.isfinite(numbers))[0])
        name = self.names[k]
        raise ObservationError(
            f"object {self._owner[name]!r}, number {name!r}: expected a finite number, got {numbers[k]}; "
            "check the env's observation before it is learned from"
        )

    # ------------------------------------------------------------------ files
    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        auto = self._auto and self.open
        return {
            "kind": "flat",
            "observation": space_to_json(self._numbers.space),
            "action": space_to_json(self._acts.space),
            "names": list(self.names),
            "parts": [part.to_json() for part in self._parts],
            "angles": "auto" if auto else [[a.cos, a.sin, a.name] for a in self.angles],
            "actions": None if self._acts.names is None else list(self._acts.names),
            "static": [s.to_json() for s in self._static],
            "axes": list(self._axes),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> NumbersView:
        """Read what `to_json` wrote."""
        space = space_from_json(data["observation"])
        return cls(
            space,
            space_from_json(data["action"]),
            names=_by_key(data["names"]) if isinstance(space, spaces.Dict) else data["names"],
            parts=[Part.from_json(part) for part in data["parts"]],
            angles="auto" if data["angles"] == "auto" else [Angle(*a) for a in data["angles"]],
            actions=data["actions"],
            static=[Static.from_json(s) for s in data["static"]],
            up=data["axes"][0],
            planar=data["axes"][1],
        )


def _angle(given: Angle | Sequence[str]) -> Angle:
    if isinstance(given, Angle):
        return given
    if isinstance(given, str) or len(given) not in (2, 3):
        raise ConfigError(f"angles: expected pairs of names (cosine, sine), got {given!r}")
    return Angle(*given)


def _named(numbers: Numbers, names: Sequence[str] | Mapping[str, Sequence[str]] | None) -> tuple[str, ...]:
    """Name of every number; those of a Dict begin with their key."""
    if not isinstance(numbers.space, spaces.Dict):
        if isinstance(names, Mapping):
            raise ConfigError(f"names={dict(names)!r}: expected a sequence of {numbers.width} names")
        given = numbered(numbers.width) if names is None else tuple(names)
        identifiers("names of the observation's numbers", given, numbers.width)
        return given
    if names is not None and not isinstance(names, Mapping):
        raise ConfigError(f"names={names!r}: expected names by key of the Dict, {{key: (name, ...)}}")
    known = [str(leaf.key) for leaf in numbers.leaves]
    if unknown := sorted(set(names or ()) - set(known)):
        raise ConfigError(f"names: the observation space has no keys {unknown}; it has {known}")
    found: list[str] = []
    for key, leaf in zip(known, numbers.leaves, strict=True):
        own = tuple((names or {}).get(key, numbered(leaf.size)))
        identifiers(f"names of the numbers of {key!r}", own, leaf.size)
        found += [f"{key}.{name}" for name in own]
    return tuple(found)


def _by_key(names: Sequence[str]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for name in names:
        key, _, own = name.rpartition(".")
        found.setdefault(key, []).append(own)
    return found
