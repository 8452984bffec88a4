"""Worlds of other packages: what is asked of a package, and who is told that it is missing.

The packages are an extra that the tests do without: that their worlds show numbers is seen where they are measured,
`relgym benchmark strangers elsewhere`.
"""

from __future__ import annotations

from collections.abc import Iterator

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.classic_control import CartPoleEnv

from relgym.errors import ConfigError
from relgym.experiments.strangers import elsewhere
from relgym.experiments.strangers.elsewhere import ELSEWHERE, WORLDS


class StandIn(CartPoleEnv):
    """An env of a package that is installed, which keeps its options."""

    def __init__(self, obs_type: str = "pixels") -> None:
        super().__init__()
        self.obs_type = obs_type


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Pong is an env that this file registers, of the package math."""
    gym.register("stand-in/Pong-v0", StandIn)
    monkeypatch.setattr(elsewhere, "WORLDS", {"Pong": ("math:stand-in/Pong-v0", {"obs_type": "ram"})})
    yield
    del gym.registry["stand-in/Pong-v0"]


def test_an_env_is_made_as_its_package_makes_it_with_the_options(installed: None) -> None:
    env = gym.make("relgym-elsewhere/Pong-v0")
    assert isinstance(env.unwrapped, StandIn)
    assert env.unwrapped.obs_type == "ram"
    observation, _ = env.reset(seed=1)
    np.testing.assert_array_equal(observation, StandIn().reset(seed=1)[0])
    env.close()


@pytest.mark.parametrize("env_id", ELSEWHERE)
def test_who_lacks_the_package_is_told_what_to_install(env_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elsewhere, "find_spec", lambda package: None)
    with pytest.raises(ConfigError, match=r"is not installed: pip install 'relgym\[bench-elsewhere\]'"):
        gym.make(env_id)


def test_each_has_an_id_and_names_its_package() -> None:
    assert all(env_id in gym.registry for env_id in ELSEWHERE)
    assert len(set(ELSEWHERE)) == len(WORLDS)
    packages = {env_id.partition(":")[0] for env_id, _ in WORLDS.values()}
    assert packages == {"ale_py", "flappy_bird_gymnasium", "mo_gymnasium"}
