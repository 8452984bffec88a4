"""Episodes from arrays and records: what is read, and what is refused in which words."""

from __future__ import annotations

import re
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from plain_envs import Slider

from relgym.data import Dataset, Episode
from relgym.errors import ConfigError, DataError

X = np.arange(6.0)[:, None]
A = np.zeros((5, 1))


def test_one_episode() -> None:
    data = Dataset.from_arrays(X[:-1], A, X[1:], rewards=np.arange(5), terminations=[0, 0, 0, 0, 1])
    (episode,) = data.episodes
    np.testing.assert_array_equal(episode.observations, X)
    assert (len(data), episode.terminated, episode.truncated) == (5, True, False)
    assert [episode.terminates(k) for k in range(5)] == [False] * 4 + [True]
    assert episode.reward(3) == 3
    assert dict(episode.info(0)) == {}


def test_without_next_observations_the_last_one_of_each_episode_leads_nowhere() -> None:
    data = Dataset.from_arrays(X, np.zeros((6, 1)), truncations=[0, 0, 1, 0, 0, 0])
    assert [len(e) for e in data] == [2, 2]
    np.testing.assert_array_equal(data.episodes[1].observations, X[3:])
    assert not any(e.terminated or e.truncated for e in data)


@given(
    st.lists(st.sampled_from("-tu"), min_size=1, max_size=30),
    st.integers(0, 2**32 - 1),
)
def test_episodes_are_cut_where_they_ended(ends: list[str], seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = len(ends)
    seen = rng.normal(size=(count, 2))
    following = np.concatenate([seen[1:], rng.normal(size=(1, 2))])
    over = np.array([end != "-" for end in ends])
    following[over] = rng.normal(size=(over.sum(), 2))
    data = Dataset.from_arrays(
        seen,
        np.arange(float(count))[:, None],
        following,
        terminations=[end == "t" for end in ends],
        truncations=[end == "u" for end in ends],
    )
    assert len(data) == count
    steps = [
        (e.observations[k], e.observations[k + 1], e.actions[k], e.terminates(k))
        for e in data
        for k in range(len(e))
    ]
    for k, (now, later, action, final) in enumerate(steps):
        np.testing.assert_array_equal(now, seen[k])
        np.testing.assert_array_equal(later, following[k])
        assert (action[0], final) == (k, ends[k] == "t")


def test_shuffled_rows_are_episodes_by_themselves() -> None:
    order = np.array([3, 0, 4, 1, 2])
    data = Dataset.from_arrays(X[:-1][order], A, X[1:][order], shuffled=True)
    assert [len(e) for e in data] == [1] * 5


def test_spaces_that_arrays_suggest() -> None:
    data = Dataset.from_arrays(
        {"pole": X.astype(np.float32)[:-1], "seat": np.array([0, 3, 1, 0, 0])},
        [0, 2, 1, 0, 0],
        shuffled=False,
    )
    assert data.action_space == spaces.Discrete(3)
    assert data.observation_space == spaces.Dict(
        pole=spaces.Box(-np.inf, np.inf, (1,), np.float32), seat=spaces.Discrete(4)
    )
    assert data.episodes[0].observations[1]["seat"] == 3
    flags = Dataset.from_arrays(X[:-1], np.array([[True], [False], [True], [True], [False]]))
    assert flags.action_space == spaces.MultiBinary(1)
    pairs = Dataset.from_arrays(np.arange(10, dtype=np.int16).reshape(5, 2), A)
    assert pairs.observation_space == spaces.Box(-32768, 32767, (2,), np.int16)
    assert Dataset.from_arrays([-1, 2, 0, 1], [[0.5]] * 4).observation_space == spaces.Discrete(4, start=-1)


def test_columns_of_choices() -> None:
    data = Dataset.from_arrays(X[:-1], np.array([[0], [1], [1], [0], [1]]))
    assert data.action_space == spaces.Discrete(2)
    assert (
        Dataset.from_arrays(X[:-1], np.array([[0], [1], [1], [0], [1]]), action_space=spaces.Discrete(2))
        .episodes[0]
        .actions[1]
        == 1
    )


def test_spaces_without_arrays() -> None:
    data = Dataset.from_arrays(
        ["to", "be", "or"],
        [0, 1, 0],
        ["be", "or", "not"],
        observation_space=spaces.Text(8),
        action_space=spaces.Discrete(2),
    )
    assert data.episodes[0].observations == ["to", "be", "or", "not"]
    both = spaces.Tuple((spaces.Text(8), spaces.Box(-9, 9, (1,), np.float64)))
    data = Dataset.from_arrays((["a", "b"], X[:2]), [0, 1], observation_space=both)
    assert data.episodes[0].observations[1][0] == "b"


def test_an_env_says_what_arrays_do_not() -> None:
    env = gym.make("relgym/TruckPush-v0")
    lived = Dataset.collect(env, 5, seed=0)
    assert lived.schema == env.get_wrapper_attr("schema")
    assert lived.metadata["env"] == "relgym/TruckPush-v0"
    episode = lived.episodes[0]
    arrays = {
        name: np.array([o[name] for o in episode.observations[:-1]]) for name in episode.observations[0]
    }
    again = Dataset.from_arrays(arrays, np.array(episode.actions), env=env)
    assert (again.schema, again.metadata) == (lived.schema, lived.metadata)
    assert "5 steps" in repr(lived)
    assert len(again) == len(episode) - 1


def test_collected_with_a_policy() -> None:
    data = Dataset.collect(Slider(4), 10, lambda seen: np.array([0.5 if seen[1] < 0 else -0.5]), seed=0)
    assert [len(e) for e in data] == [4, 4, 2]
    assert [e.truncated for e in data] == [True, True, False]
    for episode in data:
        for seen, action in zip(episode.observations, episode.actions, strict=False):
            assert action[0] == (0.5 if seen[1] < 0 else -0.5)
    with pytest.raises(ConfigError, match="steps=0"):
        Dataset.collect(Slider(4), 0)


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "fewer actions": ({"actions": A[:3]}, "actions: expected 5 rows, as many as observations, got 3"),
    "fewer next": ({"next_observations": X[2:]}, "next_observations: expected 5 rows"),
    "fewer rewards": ({"rewards": [1.0]}, "rewards: expected 5 rows"),
    "rewards of words": ({"rewards": ["a"] * 5}, "rewards: expected a number for each step"),
    "fewer flags": ({"terminations": [0, 1]}, "terminations: expected 5 flags, one for each step"),
    "flags of words": ({"truncations": ["no"] * 5}, "truncations: expected booleans"),
    "flags beyond 1": ({"truncations": [0, 1, 2, 0, 0]}, "truncations: expected booleans, or 0 and 1"),
    "not contiguous": (
        {"next_observations": X[1:] + 0.5},
        "the episode isn't contiguous: step 0 led to .*mark step 0 in terminations or truncations.*shuffled=True",
    ),
    "shuffled alone": ({"next_observations": None, "shuffled": True}, "need next_observations"),
    "words": (
        {"observations": np.array(["a"] * 5), "next_observations": None},
        "got dtype <U1; pass observation_space=",
    ),
    "objects": ({"actions": np.array([None] * 5)}, "actions: expected an array of numbers, got dtype object"),
    "one column": ({"observations": np.arange(5.0), "next_observations": None}, r"reshape\(-1, 1\)"),
    "ragged": ({"observations": [[1.0], [1.0, 2.0]] + [[1.0]] * 3}, "rows of different lengths"),
    "a number": ({"observations": 3.0}, "expected an array or a list with a row for each step, got float"),
    "nan actions": (
        {"actions": np.full((5, 1), np.nan)},
        r"episode 0, action 0: array\(\[nan\]\) \(float64\)",
    ),
    "a float choice": (
        {"actions": np.array([0.0, 1.0, 0.0, 1.0, 1.0]), "action_space": spaces.Discrete(2)},
        r"action 0: np.float64\(0.0\) \(float64\) can't be read as one of Discrete\(2\)",
    ),
    "no such choice": ({"actions": [0, 1, 2, 0, 0], "action_space": spaces.Discrete(2)}, "action 2"),
    "parts of other lengths": (
        {"observations": {"a": X, "b": X[:-1]}, "next_observations": None},
        "expected equally many rows of all parts",
    ),
    "empty": (
        {"observations": X[:0], "actions": A[:0], "next_observations": X[:0]},
        "no steps to learn from",
    ),
    "one row": (
        {"observations": X[:1], "actions": A[:1], "next_observations": None},
        "no steps to learn from",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_arrays_that_can_not_be_read(case: str) -> None:
    changes, words = BAD[case]
    with pytest.raises(DataError, match=words):
        Dataset.from_arrays(**({"observations": X[:-1], "actions": A, "next_observations": X[1:]} | changes))


BAD_EPISODES: dict[str, tuple[Any, str]] = {
    "none": ([], "no episodes"),
    "a path": ("data", "expected episodes, got str"),
    "no record": ([3], "episode 0: expected a record or a dict .* got int without observations"),
    "no actions": ([{"observations": X}], "without actions"),
    "lengths": (
        [{"observations": X, "actions": A[:2]}],
        "episode 0: an episode of 2 actions: expected 3 observations.*got 6",
    ),
    "rewards": ([{"observations": X, "actions": A, "rewards": [1.0]}], "expected 5 rewards, got 1"),
    "early end": (
        [{"observations": X, "actions": A, "terminations": [0, 1, 0, 0, 0]}],
        "terminations marks step 1 of 5; only the last step",
    ),
}


@pytest.mark.parametrize("case", BAD_EPISODES)
def test_episodes_that_can_not_be_read(case: str) -> None:
    episodes, words = BAD_EPISODES[case]
    with pytest.raises(DataError, match=words):
        Dataset.from_episodes(episodes)


def test_episodes_with_choices_of_their_own_share_a_space() -> None:
    data = Dataset.from_episodes([{"observations": X, "actions": [k] * 5} for k in (0, 2)])
    assert data.action_space == spaces.Discrete(3)


def test_infos_come_with_the_observations() -> None:
    (episode,) = Dataset.from_episodes(
        [{"observations": X, "actions": A, "infos": {"k": np.arange(6), "in": {"j": np.arange(6) * 2}}}]
    )
    assert episode.info(2) == {"k": 2, "in": {"j": 4}}
    with pytest.raises(DataError, match=re.escape("expected 6 infos, got 1")):
        Episode(X, A, infos=[{}])


def test_rows_of_parts_are_told_from_columns() -> None:
    pair = spaces.Tuple((spaces.Discrete(3), spaces.Discrete(3)))
    seen = np.zeros((3, 2))

    def acted(actions: Any) -> list[Any]:
        data = Dataset.from_episodes([{"observations": seen, "actions": actions}], action_space=pair)
        return [tuple(map(int, action)) for action in data.episodes[0].actions]

    assert acted(((0, 1), (2, 0))) == [(0, 1), (2, 0)]  # two rows
    assert acted([(0, 1), (2, 0)]) == [(0, 1), (2, 0)]
    assert acted((np.array([0, 2]), np.array([1, 0]))) == [(0, 1), (2, 0)]  # a column for each part


def test_choices_of_parts_are_those_of_all_episodes() -> None:
    seen = np.zeros((3, 2))
    given = [{"observations": seen, "actions": {"grip": np.array(grip)}} for grip in ([0, 1], [1, 2])]
    assert Dataset.from_episodes(given).action_space == spaces.Dict({"grip": spaces.Discrete(3)})
