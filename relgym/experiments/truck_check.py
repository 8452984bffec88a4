"""Is a learned truck model the right one? Its modes against Table 3.1, and its roles (§3.1, §3.5.1)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from relgym.clustering.mode import Mode
from relgym.envs.truck_scenes import stacks_of
from relgym.experiments.analytic import TruckMode, truck_modes
from relgym.experiments.episodes import Episode
from relgym.model.reports.text import Cell, table
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Scene

__all__ = ["TruckCheck", "check_truck", "truck_mode_of"]

_SAME = 1e-9
"""Largest difference of coefficients that count as equal."""


@dataclass(frozen=True, slots=True)
class TruckCheck:
    """How a learned model of the truck's velocity compares with Table 3.1.

    Attributes
    ----------
    laws
        Name of every true law, and the id of the learned mode that states it to 1e-9; 0 if none does.
    spurious
        Ids of learned modes that are no true law.
    noise
        Training examples that no mode explains.
    queries
        Test transitions that were predicted one by one.
    right_mode, right_roles
        In how many of them the true law was chosen, and in how many every role was played by a box with that
        load.
    """

    laws: tuple[tuple[str, int], ...]
    spurious: tuple[int, ...]
    noise: int
    queries: int
    right_mode: int
    right_roles: int

    @property
    def perfect(self) -> bool:
        """Whether the model is exactly Table 3.1, and every query had the right mode and roles."""
        found = all(mode for _, mode in self.laws) and not self.spurious and not self.noise
        return found and self.right_mode == self.right_roles == self.queries

    def __str__(self) -> str:
        rows: list[list[Cell]] = [
            [name, f"mode {mode}" if mode else "not learned"] for name, mode in self.laws
        ]
        spurious = ", ".join(map(str, self.spurious)) or "none"
        right = f"right mode in {self.right_mode:,}, right roles in {self.right_roles:,}"
        return (
            table(["law of Table 3.1", "learned to 1e-9 as"], rows)
            + f"\n\nother modes: {spurious}; noise: {self.noise} examples"
            + f"\nof {self.queries:,} queries: {right}"
        )


def check_truck(model: WorldModel, episodes: Iterable[Episode], *, every: int = 1) -> TruckCheck:
    """Compare a model of the truck's velocity with the true laws, and query it one scene at a time.

    Parameters
    ----------
    model
        The model; unchanged.
    episodes
        Episodes that it hasn't learned from.
    every
        Ask about every so many transitions.

    Notes
    -----
    Cost: about 1 ms per query.
    """
    part = model.property_model("truck", "vx")
    queries = right_mode = right_roles = 0
    laws: dict[str, int] = {}
    for episode in episodes:
        boxes = sum(len(stack) for stack in stacks_of(episode.scene(0)))
        true = truck_modes(boxes)
        known = {mode.id: truck_mode_of(mode, true) for mode in part.modes}
        laws |= {law.name: next((m for m, own in known.items() if own == law), 0) for law in true}
        for k in range(0, len(episode), every):
            scene = episode.scene(k)
            answer = model.predict_one(scene)["truck", "vx"]
            queries += 1
            right_mode += known.get(answer.mode) == true[int(episode.truth.mode["truck.vx"][k])]
            right_roles += answer.ok and _roles_are_right(scene, part.mode(answer.mode), answer.roles)
    spurious = tuple(m.id for m in part.modes if m.id not in laws.values())
    noise = part.clusterer.noise_examples
    return TruckCheck(tuple(laws.items()), spurious, noise, queries, right_mode, right_roles)


def truck_mode_of(mode: Mode, laws: Iterable[TruckMode]) -> TruckMode | None:
    """The true law that a learned mode states to 1e-9, if any does."""
    own, *others = mode.roles
    weights = dict(own.terms)
    force = [w for role in others if role.type == "action" for _, w in role.terms]
    frictions = sorted(w for role in others if role.type == "box" for _, w in role.terms)
    for law in laws:
        expected = [1.0, law.force_weight, *sorted(law.friction_weights)]
        found = [weights.get("vx", 0.0), *force, *frictions]
        same = len(found) == len(expected) and abs(mode.intercept) <= _SAME
        if same and all(abs(a - b) <= _SAME for a, b in zip(found, expected, strict=True)):
            return law
    return None


def _roles_are_right(scene: Scene, mode: Mode, roles: tuple[str, ...]) -> bool:
    """Whether every friction weight goes to the lowest box of a stack of that height."""
    stacks = stacks_of(scene)
    law = truck_mode_of(mode, truck_modes(sum(map(len, stacks))))
    if law is None:
        return False
    by_height = dict(zip(law.heights, law.friction_weights, strict=True))
    # A height is missing if the mode belongs to another layout: then no role can be right.
    expected = {stack[0]: by_height.get(len(stack), math.nan) for stack in stacks}
    played = {
        name: sum(w for _, w in role.terms)
        for name, role in zip(roles, mode.roles, strict=True)
        if role.type == "box"
    }
    return played.keys() == expected.keys() and all(abs(played[n] - expected[n]) <= _SAME for n in played)
