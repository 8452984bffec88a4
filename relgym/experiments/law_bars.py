"""Issue "One law per interaction": what must be shown, row by row, measured against its bar.

``python -m relgym.experiments.law_bars 1 3 --seeds 2 --json laws.json`` measures rows 1 and 3 with two training
seeds and writes the figures down as well. Every transition counts, corners and double contacts included.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from time import perf_counter
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from relgym.config import ModelConfig
from relgym.experiments.bar import Measure, measured, report
from relgym.experiments.blocks import Block
from relgym.experiments.data import BALL_EXPERIMENTS, BallExperiment, ball_blocks, truck_blocks
from relgym.experiments.rollouts import largest_errors
from relgym.experiments.rooms import Room, rooms
from relgym.model.report import report as report_of
from relgym.model.world_model import WorldModel
from relgym.scene.objects import Transition
from relgym.scene.relations import Extractor

__all__ = ["Score", "main", "score", "taught"]

WRONG: Final = 1e-9
"""A velocity component off by more than this is wrong."""

SEEDS: Final = tuple(range(400, 410))
"""Training seeds; nothing was chosen on them."""

TESTS: Final = tuple(range(500, 505))
"""Seeds of the test sets, 24,000 transitions each."""

Rows: TypeAlias = tuple[str, list[Measure], list[str]]


@dataclass(frozen=True, slots=True)
class Score:
    """One-step predictions: how many, wrong ones, and those that the model declined to make."""

    transitions: int
    wrong: int
    silent: int


def score(model: WorldModel, parts: Iterable[Block | Room]) -> Score:
    """Predict every transition one step ahead."""
    total = wrong = silent = 0
    for layout, group in groupby(parts, key=lambda part: part.layout):
        for part in group:
            found = model.predict_batch(layout, part.vectors[:-1])
            columns = [layout.column(layout.index(name), prop) for name, prop in found.parts]
            off = np.abs(found.vectors[:, columns] - part.vectors[1:, columns]).max(axis=1) > WRONG
            total += len(off)
            wrong += int((off & found.ok).sum())
            silent += int((~found.ok).sum())
    return Score(total, wrong, silent)


def taught(parts: Iterable[Block], keep: Callable[[Block], NDArray[np.bool_]] | None = None) -> WorldModel:
    """A model that learned, one by one, the transitions that `keep` marks (default: all)."""
    model: WorldModel | None = None
    for block in parts:
        model = model or WorldModel(block.schema)
        marked = np.ones(len(block), dtype=bool) if keep is None else keep(block)
        for use, transition in zip(marked.tolist(), block.transitions(), strict=True):
            if use:
                model.learn_one(transition)
    assert model is not None, "no blocks, no schema"
    return model


def _one_step(seeds: Sequence[int]) -> Rows:
    measures, notes = [], []
    for experiment in (1, 2):
        scores = []
        sentences: set[int] = set()
        for seed in seeds:
            model = taught(ball_blocks(experiment, seed=seed))
            scores += [score(model, ball_blocks(experiment, seed=test, test=True)) for test in TESTS]
            sentences.add(len(report_of(model).laws))
        for name, values in (("wrong", [s.wrong for s in scores]), ("silent", [s.silent for s in scores])):
            measures.append(measured(f"experiment {experiment}: {name} of 24,000", 0, values))
        measures.append(measured(f"experiment {experiment}: sentences", 3, sorted(sentences)))
        notes.append(model.describe(frame="world", incline=BALL_EXPERIMENTS[experiment].incline))
    return "one step", measures, notes


def _rollouts(seeds: Sequence[int]) -> Rows:
    measures = []
    for experiment in (1, 2):
        values = []
        for seed in seeds:
            model = taught(ball_blocks(experiment, seed=seed))
            for test in TESTS:
                blocks = list(ball_blocks(experiment, seed=test, blocks=80, test=True))
                values.append(int((largest_errors(model, blocks) > 1e-6).sum()))
        measures.append(measured(f"experiment {experiment}: of 80 off by more than 1e-6", 0, values))
    return "roll-outs of 200 steps", measures, []


def _transfer(seeds: Sequence[int]) -> Rows:
    measures = []
    for incline, elasticity, friction in ((30.0, 0.9, 0.0), (30.0, 0.9, 0.2), (45.0, 0.95, 0.2)):
        home = BallExperiment(incline, elasticity, (friction,), 80)
        models = [taught(ball_blocks(home, seed=seed)) for seed in seeds]
        for other in (15.0, 30.0, 45.0, 60.0, 75.0):
            away = BallExperiment(other, elasticity, (friction,), 120)
            values = [_bad(score(m, ball_blocks(away, seed=TESTS[0], test=True))) for m in models]
            name = f"learned at {incline:g}, used at {other:g} degrees, mu {friction:g}: of 24,000"
            measures.append(measured(name, 0, values))
    return "other inclines", measures, []


def _rooms(seeds: Sequence[int]) -> Rows:
    measures = []
    for experiment in (1, 2):
        setting = BALL_EXPERIMENTS[experiment]
        for objects, count in ((12, 40), (60, 8)):
            values = []
            for seed in seeds:
                model = taught(ball_blocks(experiment, seed=seed))
                found = rooms(
                    count,
                    objects=objects,
                    elasticity=setting.elasticity,
                    friction=setting.frictions[0],
                    rng=np.random.default_rng([TESTS[0], seed]),
                    steps=400,
                )
                values.append(_bad(score(model, found)))
            measures.append(measured(f"laws of {experiment}, {objects} objects: of {400 * count}", 0, values))
    return "rooms never seen", measures, []


def _parts_of_the_world(seeds: Sequence[int]) -> Rows:
    measures = []
    for experiment in (1, 2):
        for kind in ("floor", "wall"):
            found = [
                score(
                    taught(ball_blocks(experiment, seed=seed), _Touching(kind)),
                    ball_blocks(experiment, seed=TESTS[0], test=True),
                )
                for seed in seeds
            ]
            name = f"experiment {experiment}, contacts with {kind}s only:"
            measures.append(measured(f"{name} wrong of 24,000", 0, [s.wrong for s in found]))
            limit = 0 if kind == "floor" else 24_000
            measures.append(measured(f"{name} silent of 24,000", limit, [s.silent for s in found]))
    return "contacts of one kind", measures, []


class _Touching:
    """Marks transitions in which the ball touches nothing but objects of one type."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._extractor: Extractor | None = None

    def __call__(self, block: Block) -> NDArray[np.bool_]:
        self._extractor = self._extractor or Extractor(block.schema)
        found = self._extractor.extract(block.layout, block.vectors[:-1])
        ball = block.layout.bodies.index(block.layout.index("ball"))
        others = [k for k, i in enumerate(block.layout.bodies) if block.layout.types[i].name != self.kind]
        return np.logical_not(found.relation("intersect")[:, ball][:, others].any(axis=1))


def _online(seeds: Sequence[int]) -> Rows:
    measures = []
    for experiment, blocks, at in ((1, 8, (1, 2, 4, 8)), (2, 40, (2, 4, 8, 16, 40))):
        exact, costs, found = [], [], {n: list[int]() for n in at}
        test = list(ball_blocks(experiment, seed=TESTS[0], test=True))
        for seed in seeds:
            model: WorldModel | None = None
            spent: list[float] = []
            for k, block in enumerate(ball_blocks(experiment, seed=seed, blocks=blocks), start=1):
                model = model or WorldModel(block.schema)
                spent += [_timed(model, transition) for transition in block.transitions()]
                if k in at:
                    found[k].append(_bad(score(model, test)))
            exact.append(found[blocks][-1] == 0)
            costs.append(1e3 * sum(spent) / len(spent))
        for n in at:
            limit = 0 if n == blocks else 24_000
            measures.append(measured(f"experiment {experiment}: wrong or silent after {n}", limit, found[n]))
        share = sum(exact) / len(exact)
        measures.append(measured(f"experiment {experiment}: exact after {blocks}, share", 0.9, [share], ">="))
        measures.append(measured(f"experiment {experiment}: predict and learn, ms", 1.0, costs))
    return "online", measures, []


def _timed(model: WorldModel, transition: Transition) -> float:
    start = perf_counter()
    model.predict_one(transition.before)
    model.learn_one(transition)
    return perf_counter() - start


def _no_contact(seeds: Sequence[int]) -> Rows:
    differences, ratios = [], []
    for seed in seeds:
        parts = []
        for frames in ("auto", "world"):
            start, model = perf_counter(), None
            for block in truck_blocks("step", seed=seed, repeats=1):
                model = model or WorldModel(block.schema, ModelConfig(frames=frames))
                for transition in block.transitions():
                    model.learn_one(transition)
            assert model is not None, "no blocks, no schema"
            parts.append((json.dumps(model.to_json()["targets"]), perf_counter() - start))
        differences.append(parts[0][0] != parts[1][0])
        ratios.append(parts[0][1] / parts[1][1])
    title = "truck-push: nothing for laws to say"
    return title, [measured("other modes", 0, differences), measured("time, ratio", 1.2, ratios)], []


def _bad(found: Score) -> int:
    return found.wrong + found.silent


ROWS: Final[dict[int, Callable[[Sequence[int]], Rows]]] = {
    1: _one_step,
    2: _rollouts,
    3: _transfer,
    4: _rooms,
    5: _parts_of_the_world,
    6: _online,
    9: _no_contact,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the rows named on the command line and print them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", type=int, nargs="+", choices=sorted(ROWS))
    parser.add_argument("--json", type=Path, help="where to write the figures")
    parser.add_argument("--seeds", type=int, help="only so many training seeds")
    chosen = parser.parse_args(arguments)
    found: dict[int, Any] = {}
    for row in chosen.rows:
        title, measures, notes = ROWS[row](SEEDS[: chosen.seeds])
        found[row] = {"title": title, "measures": [m.to_json() for m in measures], "notes": notes}
        print(report(f"row {row}: {title}", measures, notes), flush=True)
    if chosen.json:
        chosen.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
