"""What a model's file says of how its env was made."""

from __future__ import annotations

import json

import gymnasium as gym
import numpy as np
import pytest

import relgym  # noqa: F401 - registers the envs
from relgym.envs.model_files import made_how


def test_an_env_made_without_gym_has_no_origin() -> None:
    assert made_how(None) == {}


def test_arguments_that_differ_from_the_registered_ones() -> None:
    assert made_how(gym.make("CartPole-v1").spec) == {"env": "CartPole-v1"}
    assert made_how(gym.make("Blackjack-v1").spec) == {"env": "Blackjack-v1"}
    made = gym.make("Blackjack-v1", natural=True)
    assert made_how(made.spec) == {"env": "Blackjack-v1", "arguments": {"natural": True}}
    made = gym.make("CartPole-v1", max_episode_steps=70)
    assert made_how(made.spec)["arguments"] == {"max_episode_steps": 70}


def test_how_it_is_shown_is_left_out() -> None:
    pytest.importorskip("pygame")
    assert made_how(gym.make("CartPole-v1", render_mode="rgb_array").spec) == {"env": "CartPole-v1"}


def test_arguments_are_plain_data_or_said_to_be_omitted() -> None:
    spec = gym.make("relgym/TruckPush-v0", friction_range=(0.1, np.float64(0.2))).spec
    assert spec is not None
    spec.kwargs |= {"task": None, "referee": print, "places": np.zeros(2), "by": {"box": (1, 2)}}
    told = made_how(spec)
    assert told["arguments"] == {"friction_range": [0.1, 0.2], "task": None, "by": {"box": [1, 2]}}
    assert told["omitted"] == ["referee", "places"]
    assert json.loads(json.dumps(told)) == told


def test_wrappers_are_named() -> None:
    env = gym.wrappers.FlattenObservation(gym.make("CartPole-v1"))
    assert made_how(env.spec)["wrappers"] == ["FlattenObservation"]
