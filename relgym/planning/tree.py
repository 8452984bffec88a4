"""A search tree that spreads over the states that can be reached: for goals behind obstacles (§5.1)."""

from __future__ import annotations

from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from relgym.arguments import array_of, refusing_calls
from relgym.envs.arguments import checked_count
from relgym.errors import ConfigError
from relgym.planning.actions import ActionCoder
from relgym.planning.rollouts import Objective, Plan
from relgym.planning.sequences import Search
from relgym.planning.simulators import Simulator
from relgym.scene.objects import Float1D, Float2D

__all__ = ["TreeSearch"]

_COARSER: Final = 8
"""How many of the fine cells' widths a coarse cell is wide: with 32 cells a property has four coarse ones."""


@refusing_calls(ConfigError)
@dataclass(frozen=True, slots=True, kw_only=True)
class TreeSearch:
    """Grows a tree of states where it has hardly been, and takes the best branch.

    Sequences of actions that are drawn about a mean stay this side of an obstacle when the way round it pays less at
    first. The tree goes wherever the world lets it: it keeps, of every cell of a grid over the properties that change,
    the best branch, and grows again from cells that were seldom grown from (cells as in Go-Explore, Ecoffet et al.
    2021; kinodynamic trees, LaValle and Kuffner 2001, the RRT that the thesis wished for, §5.1). There are two grids,
    and each batch grows from one: in fine cells states that differ a little stay apart, as a narrow goal asks for; but
    there are so many of them that nearly every state is the first in its own, and none is rare. Of the coarse ones
    those far from all that is usual are soon told from the others. While it grows,
    branches of different lengths are compared as if what remains of the horizon paid the mean reward of all steps of
    the tree. The plan is a whole branch: one that ends the episode or lasts to the horizon, or, with curiosity, leads
    to a step of unknown outcome. Of others nobody knows what they lead to: who races towards a goal does well until
    he can't brake any more. Only while there is no whole branch the best part of one is the plan.

    Parameters
    ----------
    horizon
        Decisions that a branch lasts at most.
    expansions
        Branches tried.
    batch
        Branches tried at once: one call of the simulator for each decision of theirs.
    hold
        Most decisions that an action is held for; the numbers tried are the powers of two up to it.
    cells
        Intervals that the range of each changing property is cut into by the fine grid; an eighth of it by the coarse
        one.
    greedy
        Share of the expansions that begin at the best branches so far, in [0, 1].
    patience
        Ends the search when so many expansions have not improved the best branch that ends the episode.
    refine
        A search over sequences that goes on from the tree's plan; None: the plan is the branch.

    Notes
    -----
    Cost: for each of the ``expansions`` as many decisions of the simulator as the mean of the powers of two up to
    ``hold``; memory for as many states as there are decisions.
    Branches of which an outcome isn't known end there: with what `Objective.curiosity` says it is worth, or, without
    it, before the step of unknown outcome, which is then no part of any plan.
    """

    horizon: int = 50
    expansions: int = 8_192
    batch: int = 128
    hold: int = 8
    cells: int = 32
    greedy: float = 0.3
    patience: int = 4_096
    refine: Search | None = None

    def __post_init__(self) -> None:
        for name in ("horizon", "expansions", "batch", "hold", "cells", "patience"):
            checked_count(name, getattr(self, name), 1, 10**9)
        if not 0.0 <= self.greedy <= 1.0:
            raise ConfigError(f"greedy={self.greedy!r}: expected a share in [0, 1]")

    def plan(
        self,
        simulator: Simulator,
        coder: ActionCoder,
        start: Float1D,
        objective: Objective,
        *,
        warm: Float2D | None,
        rng: np.random.Generator,
        deadline: float | None,
    ) -> Plan:
        """See `Search.plan`; the last plan is not needed."""
        start = array_of("start", start, (None,), ConfigError)
        tree = _Tree(start, self.cells, self.horizon, objective)
        fresh, tried = 0, 0
        while tried < self.expansions and fresh < self.patience:
            if tried and deadline is not None and perf_counter() >= deadline:
                break
            improved = self._expand(tree, simulator, coder, objective, rng)
            tried += self.batch
            # While none that ends the episode is the best of all there is no reason to stop.
            settled = tree.ended >= 0 and tree.best() == tree.ended
            fresh = fresh + self.batch if settled and not improved else 0
        plan = tree.branch(tree.best(), coder)
        if self.refine is None:
            return plan
        return self._refined(plan, simulator, coder, start, objective, rng, deadline)

    def _expand(
        self,
        tree: _Tree,
        simulator: Simulator,
        coder: ActionCoder,
        objective: Objective,
        rng: np.random.Generator,
    ) -> bool:
        """One batch of branches; whether the best one that ends the episode has become better."""
        nodes = tree.chosen(self.batch, self.greedy, rng)
        latents = rng.standard_normal((len(nodes), coder.size))
        # 1, 2, 4, … decisions, each as often: to coast to a halt takes many, to steer few.
        hold = min(2 ** int(rng.integers(int(np.log2(self.hold)) + 1)), self.horizon)
        actions = coder.actions(latents)
        before = tree.ended_worth
        alive = np.arange(len(nodes))
        for _ in range(hold):
            alive = alive[tree.depths[nodes[alive]] < self.horizon]
            if not len(alive):
                break
            states = tree.states[nodes[alive]]
            stepped = simulator.step(states, actions[alive])
            worth = stepped.rewards
            if objective.bonus is not None:
                worth = worth + objective.bonus(states, actions[alive], stepped.states)
            worth = objective.discount ** tree.depths[nodes[alive]] * worth
            known = stepped.known
            if objective.curiosity is not None and not known.all():
                off = nodes[alive[~known]]
                curious = np.asarray(objective.discount ** tree.depths[off] * objective.curiosity, np.float64)
                tree.leave(off, curious, latents[alive[~known]])
            grown = tree.grow(
                nodes[alive[known]],
                stepped.states[known],
                stepped.rewards[known],
                worth[known],
                latents[alive[known]],
                stepped.terminated[known],
            )
            nodes = nodes.copy()
            nodes[alive[known]] = grown
            alive = alive[known & ~stepped.terminated]
        tree.settle(nodes[alive])
        return tree.ended_worth > before

    def _refined(
        self,
        plan: Plan,
        simulator: Simulator,
        coder: ActionCoder,
        start: Float1D,
        objective: Objective,
        rng: np.random.Generator,
        deadline: float | None,
    ) -> Plan:
        """The plan, or what a search about it finds that is better."""
        assert self.refine is not None, "asked only then"
        other = self.refine.plan(
            simulator, coder, start, objective, warm=plan.latents, rng=rng, deadline=deadline
        )
        return other if other.worth > plan.worth else plan


@dataclass
class _Grid:
    """Cells of one width: the best node of each, and how often it was grown from."""

    cells: int
    range: Float1D | None = None
    members: dict[bytes, int] = field(default_factory=dict)
    visits: dict[bytes, int] = field(default_factory=dict)
    root_visits: int = 0


@dataclass
class _Tree:
    """States that were reached, each with the decision that led to it."""

    start: Float1D
    cells: int
    horizon: int
    objective: Objective
    states: Float2D = field(init=False)
    rewards: Float1D = field(init=False)
    worths: Float1D = field(init=False)
    depths: NDArray[np.intp] = field(init=False)
    parents: NDArray[np.intp] = field(init=False)
    latents: Float2D | None = field(init=False, default=None)
    size: int = field(init=False, default=1)
    ended: int = field(init=False, default=-1)
    ended_worth: float = field(init=False, default=-np.inf)
    whole: int = field(init=False, default=-1)
    whole_worth: float = field(init=False, default=-np.inf)
    left: int = field(init=False, default=-1)
    left_worth: float = field(init=False, default=-np.inf)
    worths_gained: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        room = 1024
        self.states = np.empty((room, len(self.start)))
        self.states[0] = self.start
        self.rewards, self.worths = np.zeros(room), np.zeros(room)
        self.depths, self.parents = np.zeros(room, dtype=np.intp), np.full(room, -1, dtype=np.intp)
        self._low, self._high = self.start.copy(), self.start.copy()
        self._grids = [_Grid(cells) for cells in sorted({self.cells, max(2, self.cells // _COARSER)})]
        self._place(np.zeros(1, dtype=np.intp))

    def chosen(self, count: int, greedy: float, rng: np.random.Generator) -> NDArray[np.intp]:
        """Nodes to grow from: the best of seldom visited cells, and of all the best. The root always is one."""
        grid = self._grids[int(rng.integers(len(self._grids)))]
        keys = [key for key, node in grid.members.items() if self.depths[node] < self.horizon]
        nodes = np.array([0, *(grid.members[key] for key in keys)], dtype=np.intp)
        visits = np.array([grid.root_visits, *(grid.visits[key] for key in keys)], dtype=np.float64)
        weights = 1.0 / np.sqrt(1.0 + visits)
        drawn = rng.choice(len(nodes), size=count, p=weights / weights.sum())
        eager = rng.random(count) < greedy
        if eager.any():
            best = np.argsort(-self.scores(nodes), kind="stable")[: max(1, len(nodes) // 20)]
            drawn[eager] = best[rng.integers(len(best), size=int(eager.sum()))]
        for k in drawn.tolist():
            if k:
                grid.visits[keys[k - 1]] += 1
            else:
                grid.root_visits += 1
        return nodes[drawn]

    def scores(self, nodes: NDArray[np.intp]) -> Float1D:
        """Worth of branches that go on, as if the rest of the horizon paid the mean of all steps so far."""
        mean = float(self.worths_gained / max(self.size - 1, 1))
        score: Float1D = self.worths[nodes] + (self.horizon - self.depths[nodes]) * mean
        return score

    def grow(
        self,
        parents: NDArray[np.intp],
        states: Float2D,
        rewards: Float1D,
        worths: Float1D,
        latents: Float2D,
        ended: NDArray[np.bool_],
    ) -> NDArray[np.intp]:
        """Add a node to each parent; returns their numbers."""
        count = len(parents)
        self._make_room(self.size + count, latents.shape[1])
        new = np.arange(self.size, self.size + count)
        self.states[new], self.rewards[new] = states, rewards
        self.worths[new] = self.worths[parents] + worths
        self.depths[new], self.parents[new] = self.depths[parents] + 1, parents
        self.worths_gained += float(worths.sum())
        assert self.latents is not None, "made with room"
        self.latents[new] = latents
        self.size += count
        if count:
            np.minimum(self._low, states.min(axis=0), out=self._low)
            np.maximum(self._high, states.max(axis=0), out=self._high)
        if ended.any():
            last = new[ended]
            best = int(last[self.worths[last].argmax()])
            if self.worths[best] > self.ended_worth:
                self.ended, self.ended_worth = best, float(self.worths[best])
        self._finish(new[~ended & (self.depths[new] >= self.horizon)])
        return new

    def _finish(self, nodes: NDArray[np.intp]) -> None:
        """Keep the best of those that lasted to the horizon."""
        if not len(nodes):
            return
        worth = self.worths[nodes].copy()
        if self.objective.value is not None:
            worth += self.objective.discount**self.horizon * self.objective.value(self.states[nodes])
        k = int(worth.argmax())
        if worth[k] > self.whole_worth:
            self.whole, self.whole_worth = int(nodes[k]), float(worth[k])

    def leave(self, parents: NDArray[np.intp], worths: Float1D, latents: Float2D) -> None:
        """Take note of steps of unknown outcome that are worth something: the best of them is kept, as a leaf."""
        total = self.worths[parents] + worths
        k = int(total.argmax())
        if total[k] <= self.left_worth:
            return
        self._make_room(self.size + 1, latents.shape[1])
        new, self.size = self.size, self.size + 1
        self.states[new], self.rewards[new], self.worths[new] = self.states[parents[k]], 0.0, total[k]
        self.depths[new], self.parents[new] = self.depths[parents[k]] + 1, parents[k]
        assert self.latents is not None, "made with room"
        self.latents[new] = latents[k]
        self.left, self.left_worth = new, float(total[k])

    def settle(self, nodes: NDArray[np.intp]) -> None:
        """Let new nodes take the cells that they are the best of."""
        if not len(nodes):
            return
        span = self._high - self._low
        # Powers of two: ranges grow as the tree does, and cells are to stay what they are for a while.
        range_ = np.exp2(np.ceil(np.log2(np.where(span > 0.0, span, 1.0))))
        range_[span == 0.0] = np.inf  # what doesn't change tells nothing apart
        for grid in self._grids:
            if grid.range is None or not np.array_equal(range_, grid.range):
                grid.range = range_
                members, grid.members, grid.visits = list(grid.members.values()), {}, {}
                self._place(np.array(members, dtype=np.intp), grid)
        self._place(nodes)

    def _place(self, nodes: NDArray[np.intp], only: _Grid | None = None) -> None:
        """Let nodes take the cells of all grids, or of one, that they are the best of."""
        scores = self.scores(nodes)
        for grid in self._grids if only is None else (only,):
            size = np.inf if grid.range is None else grid.range / grid.cells
            where = np.floor((self.states[nodes] - self.start) / size).astype(np.int16)
            keys = [row.tobytes() for row in where]
            olds = [grid.members.get(key, -1) for key in keys]
            best = dict(
                zip(
                    keys,
                    np.where(np.array(olds) < 0, -np.inf, self.scores(np.array(olds))).tolist(),
                    strict=True,
                )
            )
            for node, key, score in zip(nodes.tolist(), keys, scores.tolist(), strict=True):
                if score > best[key] or key not in grid.members:
                    grid.members[key], best[key] = node, score
                    grid.visits.setdefault(key, 0)

    def best(self) -> int:
        """The branch that is worth most: of whole ones, if there are any."""
        found, most = self.whole, self.whole_worth
        # Life goes on after a step of unknown outcome, as after any other.
        if self.left >= 0 and (worth := float(self.scores(np.array([self.left]))[0])) >= most:
            found, most = self.left, worth
        if self.ended >= 0 and self.ended_worth >= most:
            found = self.ended
        if found >= 0:
            return found
        nodes = np.array(list(self._grids[-1].members.values()), dtype=np.intp)
        scores = self.scores(nodes)
        if (value := self.objective.value) is not None:
            scores += self.objective.discount ** self.depths[nodes] * value(self.states[nodes])
        scores[nodes == 0] = -np.inf  # a plan has a first action
        return int(nodes[scores.argmax()])

    def branch(self, node: int, coder: ActionCoder) -> Plan:
        """The way from the root to a node, as a plan; of the root alone an action at the latents' middle."""
        path = []
        while node > 0:
            path.append(node)
            node = int(self.parents[node])
        path.reverse()
        if not path or self.latents is None:
            latents = np.zeros((1, coder.size))
            return Plan(
                coder.actions(latents), self.start[None].copy(), np.zeros(0), -np.inf, False, False, latents
            )
        latents = self.latents[path].copy()
        states = np.concatenate([self.start[None], self.states[path]])
        last = path[-1]
        known = last != self.left
        return Plan(
            coder.actions(latents),
            states if known else states[:-1],
            self.rewards[path if known else path[:-1]].copy(),
            float(self.worths[last]),
            last == self.ended,
            known,
            latents,
        )

    def _make_room(self, needed: int, size: int) -> None:
        room = len(self.states)
        if self.latents is None:
            self.latents = np.zeros((room, size))
        if needed <= room:
            return
        grown = max(needed, 2 * room)

        def longer(array: NDArray[Any]) -> NDArray[Any]:
            whole = np.zeros((grown, *array.shape[1:]), dtype=array.dtype)
            whole[:room] = array
            return whole

        self.states, self.rewards, self.worths = (
            longer(self.states),
            longer(self.rewards),
            longer(self.worths),
        )
        self.depths, self.parents, self.latents = (
            longer(self.depths),
            longer(self.parents),
            longer(self.latents),
        )
