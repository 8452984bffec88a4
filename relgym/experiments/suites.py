"""All benchmarks, by the suite that they belong to: what `relgym benchmark` knows."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Final

from relgym.errors import ConfigError
from relgym.experiments.benchmark import Suite

__all__ = ["SUITES", "listing", "suite"]

SUITES: Final[Mapping[str, str]] = {
    "laws": "laws.suite",
    "worlds": "worlds.suite",
    "bodies": "bodies.suite",
    "any-env": "any_env.suite",
    "strangers": "strangers.suite",
    "transitions": "transitions",
    "outliers": "outliers",
    "soak": "soak",
    "dyna": "dyna.suite",
    "plan": "plan.suite",
    "speed": "speed.suite",
    "agreement": "agreement",
}
"""Modules of `relgym.experiments` that declare them, by name."""


def suite(name: str) -> Suite:
    """A suite by its name.

    Raises
    ------
    ConfigError
        There is none of that name.
    """
    if name not in SUITES:
        raise ConfigError(f"benchmark {name!r}: expected one of {', '.join(SUITES)}")
    found: Suite = import_module(f"relgym.experiments.{SUITES[name]}").SUITE
    return found


def listing() -> dict[str, str]:
    """Title of each suite and names of its benchmarks, by name."""
    found = {}
    for name in SUITES:
        known = suite(name)
        found[name] = f"{known.title} ({', '.join(known.benchmarks)})"
    return found
