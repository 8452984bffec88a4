"""Make the corpus' files of small worlds anew: ``python tests/fuzz/make_corpus.py``.

Between them they hold what the files of other people's worlds don't: walls at work, scopes and guesses, roles with
descriptions, masses that share an impulse, spin, and laws with grips. Beside each lie some more steps of its world.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support")]

import points  # noqa: E402
from worlds import line, schema_of, transitions  # noqa: E402

from relgym.config import ClassificationConfig, ModelConfig  # noqa: E402
from relgym.experiments.law_motion import episode  # noqa: E402
from relgym.experiments.law_worlds import Ball, Material, World  # noqa: E402
from relgym.files.reading import write_arrays  # noqa: E402
from relgym.model.world_model import WorldModel  # noqa: E402
from relgym.scene.objects import Scene, Transition  # noqa: E402
from relgym.scene.schema import SceneSchema  # noqa: E402

FOLDER = Path(__file__).parent / "corpus"
SMALL = ModelConfig(
    history=100,
    classification=ClassificationConfig(
        exemplars_per_state=2, noise_per_state=5, max_exemplars=100, exemplars_alone=20
    ),
)
KEPT = 24


def puck(n: int) -> list[Transition]:
    """Pushed about in a channel: either end stops it."""
    rng, schema = np.random.default_rng(0), points.schema_of(("x", "v"), ("push",))

    def slide(state: np.ndarray, action: np.ndarray) -> list[float]:
        x, v = state
        v = 0.9 * v + action[0]
        led = x + 0.5 * v
        return [led, v] if -1.0 < led < 2.0 else [min(max(led, -1.0), 2.0), 0.0]

    starts = np.column_stack([rng.uniform(-1.0, 2.0, n), rng.normal(0.0, 1.0, n)])
    return points.transitions(schema, slide, starts, rng.uniform(-1.0, 1.0, (n, 1)))


def lander(n: int) -> list[Transition]:
    """A smooth curve that no feature fits exactly; a leg that touches is thrown about."""
    rng, schema = np.random.default_rng(0), points.schema_of(("x", "v", "leg"), ("a",))

    def moved(s: np.ndarray, u: np.ndarray) -> list[float]:
        if s[2]:
            return [s[0], 2.0 * s[0] + rng.normal(), s[2]]
        return [s[0], s[1] + 0.5 * np.tanh(1.5 * s[0]) + 0.1 * u[0], s[2]]

    starts = np.column_stack(
        [rng.uniform(-1.5, 1.5, n), rng.normal(size=n), (rng.random(n) < 0.095).astype(float)]
    )
    return points.transitions(schema, moved, starts, rng.normal(size=(n, 1)))


def cars(n: int) -> list[Transition]:
    """Cars in a line, each hit by one of others."""
    steps = line(0, n, ("light", "heavy", "heavy"))
    return transitions(schema_of(steps), steps)


def discs(n: int) -> list[Transition]:
    """Two discs of different mass that spin, in a rough room."""
    rough = Material(0.9, 0.2)
    balls = (Ball(spins=True), Ball(radius=0.15, mass=3.0, spins=True))
    world = World(2, balls, ("block",) * 5, {"block": rough}, rough, weighed=True)
    schema, rng, found = world.schema(), np.random.default_rng(0), []
    while len(found) < n:
        found += _steps(schema, episode(world, steps=60, rng=rng))
    return found


def _steps(schema: SceneSchema, vectors: np.ndarray) -> list[Transition]:
    scenes = [Scene(schema, schema.layout(), v.copy()) for v in vectors]
    return [Transition(a, b) for a, b in pairwise(scenes)]


def main() -> None:
    """Write all files."""
    FOLDER.mkdir(exist_ok=True)
    guessing = ModelConfig(features=("trig(x)",), history=400, classification=SMALL.classification)
    plans = {
        "puck": (puck(900), SMALL),
        "lander": (lander(760), guessing),
        "cars": (cars(400), SMALL),
        "discs": (discs(300), SMALL),
    }
    for name, (steps, config) in plans.items():
        model = WorldModel(steps[0].before.schema, config)
        for step in steps[:-KEPT]:
            model.learn_one(step)
        model.finish()
        model.save(FOLDER / f"{name}.relgym", history=True)
        model.save(FOLDER / f"{name}-frozen.relgym")
        scenes = {"before": [s.before for s in steps[-KEPT:]], "after": [s.after for s in steps[-KEPT:]]}
        arrays = {side: np.stack([scene.vector for scene in those]) for side, those in scenes.items()}
        (FOLDER / f"{name}.npz").write_bytes(write_arrays(arrays))
        print(model, model.governed)


if __name__ == "__main__":
    main()
