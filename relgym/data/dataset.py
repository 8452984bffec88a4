"""What an env showed, episode by episode, and the spaces and objects that tell how to read it."""

from __future__ import annotations

import importlib
import math
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from relgym.arguments import refusing_calls, whole
from relgym.envs.arguments import checked_count, checked_function
from relgym.errors import ConfigError, DataError
from relgym.model.learning.fitting import ends_of
from relgym.scene.schema import SceneSchema
from relgym.wrappers.views import metadata_of, readable, schema_of

__all__ = ["Dataset", "Episode", "Policy"]

Policy: TypeAlias = Callable[[Any], Any]
"""Action by observation."""


@refusing_calls(DataError)
@dataclass(frozen=True, slots=True)
class Episode:
    """One episode, or the part of it that was recorded.

    Attributes
    ----------
    observations
        As the env returned them, from that of `reset` on: one more than actions.
    actions
        What was done.
    rewards
        What each step was paid; ``None`` where nobody wrote it down.
    terminated, truncated
        How the last step ended it; neither where the recording just stops.
    infos
        What came with the observations, as many; ``None``: nothing.

    Raises
    ------
    DataError
        Lengths that don't fit.
    """

    observations: Sequence[Any]
    actions: Sequence[Any]
    rewards: Sequence[float] | None = None
    terminated: bool = False
    truncated: bool = False
    infos: Sequence[Mapping[str, Any]] | None = None

    def __post_init__(self) -> None:
        steps = len(self.actions)
        if len(self.observations) != steps + 1:
            raise DataError(
                f"an episode of {steps} actions: expected {steps + 1} observations, from that of reset to the one "
                f"after the last action, got {len(self.observations)}; where the last one wasn't recorded, leave out "
                "the last action"
            )
        for what, given, count in (("rewards", self.rewards, steps), ("infos", self.infos, steps + 1)):
            if given is not None and len(given) != count:
                raise DataError(f"an episode of {steps} actions: expected {count} {what}, got {len(given)}")

    def __len__(self) -> int:
        return len(self.actions)

    def info(self, k: int) -> Mapping[str, Any]:
        """What came with the k-th observation."""
        return {} if self.infos is None else self.infos[whole("k", k, 0, len(self.infos), DataError)]

    def reward(self, k: int) -> Any:
        """What the k-th step was paid; NaN where it isn't known."""
        return (
            math.nan if self.rewards is None else self.rewards[whole("k", k, 0, len(self.rewards), DataError)]
        )

    def terminates(self, k: int) -> bool:
        """Whether the k-th step ended the episode for good."""
        return self.terminated and k == len(self) - 1


@refusing_calls(DataError)
class Dataset:
    """Episodes of an env; what `relgym.fit`, `relgym.progressive` and `relgym.score` read.

    Parameters
    ----------
    episodes
        In the order in which they were lived through. One without steps counts too: dreams may start from it.
    observation_space, action_space
        The env's.
    schema
        Its objects, where its observations are scenes (`relgym.envs.SceneEnv`).
    metadata
        Plain data of the env that goes into model files: its id, ``render_fps``.

    Raises
    ------
    DataError
        No step at all, or an action outside the action space that nothing can be learned from (NaN, another shape or
        dtype, a choice that there isn't); the message says which one.

    Examples
    --------
    >>> x = np.arange(6.0)[:, None]
    >>> Dataset.from_arrays(x[:-1], np.ones((5, 1)), x[1:], truncations=[0, 0, 1, 0, 0])
    Dataset(2 episodes, 5 steps of Box(-inf, inf, (1,), float64), actions Box(-inf, inf, (1,), float64))
    """

    def __init__(
        self,
        episodes: Iterable[Episode],
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        *,
        schema: SceneSchema | None = None,
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        self.episodes = tuple(episodes)
        self.observation_space, self.action_space = observation_space, action_space
        self.schema = schema
        self.metadata = {name: value for name, value in (metadata or {}).items() if value is not None}
        if not len(self):
            raise DataError("no steps to learn from: expected an episode with at least one")
        for number, episode in enumerate(self.episodes):
            for k, action in enumerate(episode.actions):
                if readable(action_space, action) is None:
                    raise DataError(
                        f"episode {number}, action {k}: {action!r} ({_kind(action)}) can't be read as one of "
                        f"{action_space}; pass the env's action_space, and actions of its dtype"
                    )

    def __len__(self) -> int:
        return sum(map(len, self.episodes))

    def __iter__(self) -> Iterator[Episode]:
        return iter(self.episodes)

    def __repr__(self) -> str:
        count = len(self.episodes)
        return (
            f"Dataset({count:,} episode{'' if count == 1 else 's'}, {len(self):,} steps of {self.observation_space}, "
            f"actions {self.action_space})"
        )

    # ------------------------------------------------------------------ where it comes from
    @classmethod
    def from_arrays(
        cls,
        observations: Any,
        actions: Any,
        next_observations: Any = None,
        *,
        rewards: Any = None,
        terminations: Any = None,
        truncations: Any = None,
        shuffled: bool = False,
        env: gym.Env[Any, Any] | None = None,
        observation_space: spaces.Space[Any] | None = None,
        action_space: spaces.Space[Any] | None = None,
    ) -> Dataset:
        """Episodes from arrays with a row for each step.

        Parameters
        ----------
        observations
            Before each step, shape ``(n, …)``; for a Dict space a dict of arrays, for a Tuple a tuple of them, for
            spaces without arrays (text, sequences, graphs) a list.
        actions
            Shape ``(n, …)``; of parts as `observations`.
        next_observations
            After each step, as `observations`. Default: row k + 1 follows row k, but where an episode ends; what the
            last step of each episode led to is unknown then.
        rewards
            Shape ``(n,)``; needed to learn them.
        terminations, truncations
            Where episodes ended, shape ``(n,)``: for good, or because they were cut off.
        shuffled
            Whether rows are steps by themselves, in no order, as of a replay buffer; it needs `next_observations`.
        env
            An env to take spaces, objects and metadata from; nothing else is asked of it.
        observation_space, action_space
            The spaces. Default: the env's, and without one what the arrays suggest: floats are an unbounded Box of
            their dtype, one column of integers is a Discrete.

        Raises
        ------
        DataError
            Lengths that differ, other dtypes than numbers where no space says what they are, or a row that isn't
            what the step before it led to, though no end of an episode lies between.
        """
        known = (None, None) if env is None else (env.observation_space, env.action_space)
        space = observation_space or known[0] or _space_like(observations, "observations")
        acts = action_space or known[1] or _space_like(actions, "actions")
        seen = _rows(observations, space, "observations")
        done = _rows(actions, acts, "actions")
        count = len(seen)
        following = (
            None if next_observations is None else _rows(next_observations, space, "next_observations")
        )
        paid = None if rewards is None else _rewards(rewards)
        for what, given in (("actions", done), ("next_observations", following), ("rewards", paid)):
            if given is not None and len(given) != count:
                raise DataError(f"{what}: expected {count} rows, as many as observations, got {len(given)}")
        ended = ends_of(count, terminations, truncations)
        final = ends_of(count, terminations, None)
        if shuffled:
            if following is None:
                raise DataError("shuffled=True: rows that don't follow one another need next_observations")
            ended[:] = True
        elif following is not None:
            _check_contiguous(seen, following, ended)
        episodes = list(_cut(seen, done, following, paid, ended, final))
        return cls._of(episodes, env, space, acts)

    @classmethod
    def from_episodes(
        cls,
        episodes: Iterable[Any],
        *,
        env: gym.Env[Any, Any] | None = None,
        observation_space: spaces.Space[Any] | None = None,
        action_space: spaces.Space[Any] | None = None,
    ) -> Dataset:
        """Episodes from records or dicts with ``observations``, ``actions`` and, if known, the rest.

        Parameters
        ----------
        episodes
            Each an `Episode`, or something with its attributes or keys: ``observations`` (one more than actions),
            ``actions``, and if known ``rewards``, ``terminations`` and ``truncations`` (one for each step, or one for
            the episode), ``infos``. Minari's `EpisodeData` is such a record.
        env, observation_space, action_space
            As of `from_arrays`.
        """
        if isinstance(episodes, (str, bytes, Mapping)) or not isinstance(episodes, Iterable):
            raise DataError(f"expected episodes, got {type(episodes).__name__}")
        given = list(episodes)
        if not given:
            raise DataError("no episodes to learn from; expected at least one")
        known = (None, None) if env is None else (env.observation_space, env.action_space)
        space = (
            observation_space or known[0] or _space_like(_part(0, given[0], "observations"), "observations")
        )
        acts = action_space or known[1]
        if acts is None:
            acts = _common([_space_like(_part(n, e, "actions"), "actions") for n, e in enumerate(given)])
        return cls._of([_episode(n, e, space, acts) for n, e in enumerate(given)], env, space, acts)

    @classmethod
    def from_minari(
        cls, source: Any, *, env: gym.Env[Any, Any] | None = None, download: bool = False
    ) -> Dataset:
        """The episodes of a Minari data set; needs the extra `minari`.

        Parameters
        ----------
        source
            A `minari.MinariDataset`, or the id of one.
        env
            The env it was recorded in. Default: the data set's `recover_environment`; where it can't be made here,
            there is a warning, and only the spaces are known. It is needed where observations are scenes.
        download
            Whether to fetch a data set that isn't on this machine.

        Raises
        ------
        ConfigError
            Minari isn't installed.
        DataError
            There is no such data set here.

        Notes
        -----
        Minari leaves out episodes without a step (a `reset` after another, or at the very end of a recording), and
        what `reset` and `step` returned as info, unless it was recorded (``DataCollector(..., record_infos=True)``).
        """
        dataset = _minari(source, download)
        recovered = env is None
        if env is None:
            env = _recovered(dataset)
        space, acts = dataset.observation_space, dataset.action_space
        try:
            found = [_episode(n, e, space, acts) for n, e in enumerate(dataset.iterate_episodes())]
            return cls._of(found, env, space, acts)
        finally:
            if recovered and env is not None:
                env.close()

    @classmethod
    def collect(
        cls, env: gym.Env[Any, Any], steps: int, policy: Policy | None = None, *, seed: int | None = None
    ) -> Dataset:
        """Act in an env and write down what it shows.

        Parameters
        ----------
        env
            A single env.
        steps
            How many; episodes follow one another.
        policy
            Action by observation. Default: random actions.
        seed
            Of the first episode, and of random actions.
        """
        checked_count("steps", steps, 1, 10**9)
        checked_function("policy", policy, "observation")
        if seed is not None:
            env.action_space.seed(seed)
        episodes: list[Episode] = []
        log = _Log(*env.reset(seed=seed))
        for _ in range(steps):
            action = env.action_space.sample() if policy is None else policy(log.seen[-1])
            log.step(action, *env.step(action))
            if log.over:
                episodes.append(log.episode())
                log = _Log(*env.reset())
        return cls._of([*episodes, log.episode()], env, env.observation_space, env.action_space)

    def to_minari(self, dataset_id: str, *, env: gym.Env[Any, Any] | None = None, **described: Any) -> Any:
        """Keep the episodes as a Minari data set on this machine; needs the extra `minari`.

        Parameters
        ----------
        dataset_id
            ``"name-v0"``, or ``"env/name-v0"``.
        env
            The env, which whoever loads the data set can then recover.
        described
            What `minari.create_dataset_from_buffers` takes beside: ``author``, ``algorithm_name``, ``data_format``, …

        Returns
        -------
        The `minari.MinariDataset`.

        Raises
        ------
        ConfigError
            Minari isn't installed.
        DataError
            There is one of that name, or rewards weren't recorded.
        """
        minari = _library()
        if any(episode.rewards is None for episode in self.episodes):
            raise DataError("a Minari data set holds rewards, and these weren't recorded: pass rewards=")
        buffers = [
            minari.data_collector.EpisodeBuffer(
                observations=_batched(self.observation_space, episode.observations),
                actions=_batched(self.action_space, episode.actions),
                rewards=[float(episode.reward(k)) for k in range(len(episode))],
                terminations=[episode.terminates(k) for k in range(len(episode))],
                truncations=[*[False] * (len(episode) - 1), not episode.terminated],
            )
            for episode in self.episodes
            if len(episode)
        ]
        try:
            return minari.create_dataset_from_buffers(
                dataset_id,
                buffers,
                env=env,
                observation_space=self.observation_space,
                action_space=self.action_space,
                **described,
            )
        except (FileExistsError, ValueError) as error:
            raise DataError(f"{dataset_id!r} can't be made a Minari data set: {error}") from None

    @classmethod
    def _of(
        cls,
        episodes: Sequence[Episode],
        env: gym.Env[Any, Any] | None,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
    ) -> Dataset:
        if env is None:
            return cls(episodes, observation_space, action_space)
        schema = schema_of(env) if observation_space == env.observation_space else None
        return cls(episodes, observation_space, action_space, schema=schema, metadata=metadata_of(env))


class _Log:
    """An episode while it goes on."""

    def __init__(self, observation: Any, info: Mapping[str, Any]) -> None:
        self.seen, self.infos = [observation], [info]
        self._done: list[Any] = []
        self._paid: list[Any] = []
        self._flags = (False, False)

    def step(
        self,
        action: Any,
        observation: Any,
        reward: Any,
        terminated: Any,
        truncated: Any,
        info: Mapping[str, Any],
    ) -> None:
        self._done.append(action)
        self.seen.append(observation)
        self.infos.append(info)
        self._paid.append(reward)
        self._flags = (bool(terminated), bool(truncated))

    @property
    def over(self) -> bool:
        return any(self._flags)

    def episode(self) -> Episode:
        return Episode(self.seen, self._done, self._paid, *self._flags, self.infos)


# ---------------------------------------------------------------------- arrays
def _has_parts(given: tuple[Any, ...], space: spaces.Tuple[Any]) -> bool:
    """Whether what is given is a column for each part, rather than a row for each step: arrays always are columns."""
    if len(given) != len(space.spaces):
        return False
    return any([isinstance(each, np.ndarray) for each in given]) or not all([each in space for each in given])


def _rows(given: Any, space: spaces.Space[Any], what: str) -> list[Any]:
    """Single elements of a batch of them."""
    if isinstance(space, spaces.Dict) and isinstance(given, Mapping):
        if set(given) != set(space.spaces):
            raise DataError(
                f"{what}: expected the keys {sorted(space.spaces)}, got {sorted(map(str, given))}"
            )
        columns = {key: _rows(given[key], part, f"{what}[{key!r}]") for key, part in space.spaces.items()}
        _check_lengths({key: len(column) for key, column in columns.items()}, what)
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if isinstance(space, spaces.Tuple) and isinstance(given, tuple) and _has_parts(given, space):
        parts = {k: _rows(part, space.spaces[k], f"{what}[{k}]") for k, part in enumerate(given)}
        _check_lengths({k: len(column) for k, column in parts.items()}, what)
        return list(zip(*parts.values(), strict=True))
    if isinstance(given, (str, bytes)) or not hasattr(given, "__len__"):
        raise DataError(
            f"{what}: expected an array or a list with a row for each step, got {type(given).__name__}"
        )
    if not isinstance(given, np.ndarray) and _is_flat(space) and _is_numbers(given):
        given = _array(given, what)
    if isinstance(given, np.ndarray):
        if not given.ndim:
            raise DataError(f"{what}: expected a row for each step, got one number")
        if isinstance(space, spaces.Discrete) and given.shape[1:] == (1,):  # as some libraries keep them
            given = given[:, 0]
        if given.dtype == object:
            return list(given.tolist())
    return list(given)


def _is_flat(space: spaces.Space[Any]) -> bool:
    return isinstance(space, (spaces.Box, spaces.Discrete, spaces.MultiDiscrete, spaces.MultiBinary))


def _is_numbers(given: Sequence[Any]) -> bool:
    return not any(isinstance(row, np.ndarray) for row in given)


def _array(given: Any, what: str) -> Any:
    try:
        return np.asarray(given)
    except ValueError:
        raise DataError(f"{what}: expected rows of one shape, got rows of different lengths") from None


def _check_lengths(lengths: Mapping[Any, int], what: str) -> None:
    if len(set(lengths.values())) > 1:
        raise DataError(f"{what}: expected equally many rows of all parts, got {dict(lengths)}")


def _rewards(given: Any) -> list[Any]:
    try:
        array = np.asarray(given)
    except ValueError:  # ragged
        raise DataError(f"rewards: expected a number for each step, got {given!r}") from None
    if (
        array.dtype.kind not in "biuf"
        or not array.ndim
        or array.shape not in ((len(array),), (len(array), 1))
    ):
        raise DataError(
            f"rewards: expected a number for each step, got shape {array.shape}, dtype {array.dtype}"
        )
    return list(array.reshape(-1))


def _space_like(given: Any, what: str) -> spaces.Space[Any]:
    """The space that arrays suggest."""
    if isinstance(given, Mapping):
        return spaces.Dict({str(key): _space_like(part, f"{what}[{key!r}]") for key, part in given.items()})
    array = given if isinstance(given, np.ndarray) else _array(given, what)
    if not array.ndim:
        raise DataError(
            f"{what}: expected an array or a list with a row for each step, got {type(given).__name__}"
        )
    kind = array.dtype.kind
    if kind in "iu" and (array.ndim == 1 or array.shape[1:] == (1,)) and array.size:
        least = min(0, int(array.min()))
        return spaces.Discrete(int(array.max()) - least + 1, start=least)
    if kind not in "biuf":
        raise DataError(
            f"{what}: expected an array of numbers, got dtype {array.dtype}; pass observation_space= and action_space= "
            "to say what they are"
        )
    if array.ndim < 2:
        raise DataError(
            f"{what}: expected shape (n, k), got {array.shape}: reshape(-1, 1) if each row is one number, "
            "and astype(int) if it is a choice"
        )
    if kind == "b":
        return spaces.MultiBinary(array.shape[1] if array.ndim == 2 else array.shape[1:])
    dtype = array.dtype.type
    if kind == "f":
        return spaces.Box(-np.inf, np.inf, array.shape[1:], dtype)
    limits = np.iinfo(dtype)
    return spaces.Box(limits.min, limits.max, array.shape[1:], dtype)


def _common(found: Sequence[spaces.Space[Any]]) -> spaces.Space[Any]:
    """One space for the actions of all episodes."""
    first = found[0]
    parts = [space for space in found if isinstance(space, spaces.Dict)]
    if isinstance(first, spaces.Dict) and len(parts) == len(found):
        if all([part.keys() == first.keys() for part in parts]):
            return spaces.Dict({key: _common([part[key] for part in parts]) for key in first.keys()})
    discrete = [space for space in found if isinstance(space, spaces.Discrete)]
    if len(discrete) < len(found):
        return found[0]
    least = min(int(space.start) for space in discrete)
    most = max(int(space.start) + int(space.n) for space in discrete)
    return spaces.Discrete(most - least, start=least)


def _check_contiguous(
    seen: Sequence[Any], following: Sequence[Any], ended: np.typing.NDArray[np.bool_]
) -> None:
    for k in range(len(seen) - 1):
        if not ended[k] and not _same(following[k], seen[k + 1]):
            raise DataError(
                f"the episode isn't contiguous: step {k} led to {following[k]!r}, but row {k + 1} begins with "
                f"{seen[k + 1]!r}; mark step {k} in terminations or truncations if its episode ended there, or pass "
                "shuffled=True if rows don't follow one another"
            )


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, (np.ndarray, np.number)):
        return np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind == "f")
    return bool(a == b)


def _cut(
    seen: Sequence[Any],
    done: Sequence[Any],
    following: Sequence[Any] | None,
    paid: Sequence[Any] | None,
    ended: np.typing.NDArray[np.bool_],
    final: np.typing.NDArray[np.bool_],
) -> Iterator[Episode]:
    """Episodes from rows."""
    first = 0
    for k in range(len(seen)):
        if not ended[k] and k < len(seen) - 1:
            continue
        last = k + 1 if following is not None else k
        rewards = None if paid is None else paid[first:last]
        observed = [*seen[first : k + 1]] if following is None else [*seen[first : k + 1], following[k]]
        over = following is not None and bool(ended[k])
        terminated = over and bool(final[k])
        yield Episode(observed, done[first:last], rewards, terminated, over and not terminated)
        first = k + 1


# ---------------------------------------------------------------------- records of episodes
def _part(number: int, given: Any, name: str, *, needed: bool = True) -> Any:
    found = given.get(name) if isinstance(given, Mapping) else getattr(given, name, None)
    if found is None and needed:
        raise DataError(
            f"episode {number}: expected a record or a dict with observations and actions, got {type(given).__name__} "
            f"without {name}"
        )
    return found


def _episode(number: int, given: Any, space: spaces.Space[Any], acts: spaces.Space[Any]) -> Episode:
    if isinstance(given, Episode):
        return given
    seen = _rows(_part(number, given, "observations"), space, f"episode {number}: observations")
    done = _rows(_part(number, given, "actions"), acts, f"episode {number}: actions")
    rewards = _part(number, given, "rewards", needed=False)
    infos = _part(number, given, "infos", needed=False)
    over = [
        _last_flag(number, _part(number, given, many, needed=False), len(done), many)
        or bool(_part(number, given, one, needed=False))
        for many, one in (("terminations", "terminated"), ("truncations", "truncated"))
    ]
    try:
        return Episode(
            seen,
            done,
            None if rewards is None else _rewards(rewards),
            over[0],
            over[1],
            [_info_at(infos, k) for k in range(len(seen))] if infos else None,
        )
    except DataError as error:
        raise DataError(f"episode {number}: {error}") from None


def _last_flag(number: int, given: Any, count: int, what: str) -> bool:
    """Whether the last of some flags is set; `DataError` where an earlier one is."""
    if given is None or isinstance(given, (bool, np.bool_)):
        return bool(given)
    flags = ends_of(count, given, None)
    if flags[:-1].any():
        raise DataError(
            f"episode {number}: {what} marks step {int(np.flatnonzero(flags)[0])} of {count}; only the last step of "
            "an episode can end it: Dataset.from_arrays cuts one array into episodes"
        )
    return bool(flags[-1]) if count else False


def _info_at(infos: Mapping[str, Any], k: int) -> dict[str, Any]:
    return {
        key: _info_at(value, k) if isinstance(value, Mapping) else value[k] for key, value in infos.items()
    }


# ---------------------------------------------------------------------- Minari
def _minari(source: Any, download: bool) -> Any:
    """A Minari data set; `DataError` where there is none of that name."""
    if not isinstance(source, (str, os.PathLike)):
        if not hasattr(source, "iterate_episodes"):
            raise DataError(f"expected a Minari data set or the id of one, got {type(source).__name__}")
        return source
    minari = _library()
    try:
        return minari.load_dataset(os.fspath(source), download=download)
    except (FileNotFoundError, ValueError) as error:
        known = ", ".join(sorted(minari.list_local_datasets())) or "none"
        raise DataError(
            f"no Minari data set {source!r} here ({error}); there are: {known}; download=True fetches a remote one"
        ) from None


def _library() -> Any:
    try:
        return importlib.import_module("minari")
    except ImportError:
        raise ConfigError("Minari isn't installed: pip install 'relgym[minari]'") from None


def _batched(space: spaces.Space[Any], rows: Sequence[Any]) -> Any:
    """Elements as Minari keeps them: an array, or a dict, tuple or list of such."""
    if isinstance(space, spaces.Dict):
        return {key: _batched(part, [row[key] for row in rows]) for key, part in space.spaces.items()}
    if isinstance(space, spaces.Tuple):
        return tuple(_batched(part, [row[k] for row in rows]) for k, part in enumerate(space.spaces))
    return np.asarray(rows, dtype=space.dtype) if _is_flat(space) else list(rows)


def _recovered(dataset: Any) -> gym.Env[Any, Any] | None:
    """The env that a data set was recorded in, if it can be made here."""
    if dataset.env_spec is None:
        return None
    try:
        env: gym.Env[Any, Any] = dataset.recover_environment()
    except Exception as error:  # whatever other people's envs raise
        warnings.warn(
            f"the data set's env {dataset.env_spec.id} can't be made here ({error}): only its spaces are known; "
            "pass env=",
            stacklevel=4,
        )
        return None
    return env


def _kind(value: Any) -> str:
    with suppress(AttributeError):
        return str(value.dtype)
    return type(value).__name__
