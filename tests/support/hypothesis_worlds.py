"""Worlds whose laws modes can't state, as arrays; and the examples' hypothesis classes that can."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import relgym
from relgym.hypotheses import register_hypothesis

sys.path.append(str(Path(__file__).parents[2] / "examples"))

from periodic_law import PeriodicLaws
from saturating_law import SaturatingLaws

PERIODIC, SATURATING = PeriodicLaws(), SaturatingLaws()


def registered() -> tuple[str, str]:
    """Both examples' names, registered."""
    register_hypothesis(PERIODIC)
    register_hypothesis(SATURATING)
    return PERIODIC.name, SATURATING.name


def tide(seed: int, steps: int = 300, period: float = 17.3) -> relgym.Dataset:
    """x' = 0.9 x - 0.2 u + a wave of a clock t that is seen."""
    x, u = np.zeros((steps + 1, 2)), np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, 1))
    for t in range(steps):
        x[t + 1] = 0.9 * x[t, 0] - 0.2 * u[t, 0] + 0.5 * np.sin(2 * np.pi * t / period + 0.4), t + 1
    return relgym.Dataset.from_arrays(x[:-1], u, x[1:])


def motor(seed: int, steps: int = 600, noise: float = 0.003) -> relgym.Dataset:
    """v' = clip(0.8 v + 0.7 u, -0.6, 0.9), seen with an error."""
    rng = np.random.default_rng(seed)
    v, u = np.zeros((steps + 1, 1)), rng.uniform(-1.0, 1.0, (steps, 1))
    for t in range(steps):
        v[t + 1] = np.clip(0.8 * v[t] + 0.7 * u[t], -0.6, 0.9) + noise * rng.normal()
    return relgym.Dataset.from_arrays(v[:-1], u, v[1:])


def slider(seed: int, steps: int = 300, noise: float = 0.0) -> relgym.Dataset:
    """v' = 0.8 v + 0.5 u, x' = x + v': nothing but lines."""
    rng = np.random.default_rng(seed)
    s, u = np.zeros((steps + 1, 2)), rng.uniform(-1.0, 1.0, (steps, 1))
    for t in range(steps):
        v = 0.8 * s[t, 1] + 0.5 * u[t, 0]
        s[t + 1] = s[t, 0] + v, v + noise * rng.normal()
    return relgym.Dataset.from_arrays(s[:-1], u, s[1:])


def fitted(data: relgym.Dataset, *names: str, **config: Any) -> relgym.WorldModel:
    """A model of some data that may ask these classes."""
    return relgym.fit(data, config={"hypotheses": names, **config})
