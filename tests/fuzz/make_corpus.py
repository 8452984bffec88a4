"""Make the corpus' files of small worlds anew: ``python tests/fuzz/make_corpus.py [name ...]``.

Between them they hold what the files of other people's worlds don't: walls at work, scopes and guesses, roles with
descriptions, masses that share an impulse, spin, and laws with grips; views of tables, of agents and of angles, with
tasks; and a reward model. Beside each lie some more steps of its world.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[1] / "support")]

import points  # noqa: E402
from dreams import recorded  # noqa: E402
from file_fuzzing import spied  # noqa: E402
from gymnasium import spaces  # noqa: E402
from plain_envs import Birds, Wheel  # noqa: E402
from runners import Runners  # noqa: E402
from worlds import line, schema_of, transitions  # noqa: E402

from relgym.config import ClassificationConfig, ClusteringConfig, ModelConfig  # noqa: E402
from relgym.envs import AgentsEnv  # noqa: E402
from relgym.envs.views import AgentsView, NumbersView, Static, TableView  # noqa: E402
from relgym.experiments.laws.motion import episode  # noqa: E402
from relgym.experiments.laws.worlds import Ball, Material, World  # noqa: E402
from relgym.files.reading import write_arrays  # noqa: E402
from relgym.model.world_model import WorldModel  # noqa: E402
from relgym.scene.objects import ACTION, Scene, Transition  # noqa: E402
from relgym.scene.schema import SceneSchema  # noqa: E402
from relgym.wrappers import ModelLearner  # noqa: E402
from relgym.wrappers.dyna.reward_models import LearnedRewardModel  # noqa: E402

FOLDER = Path(__file__).parent / "corpus"
SMALL = ModelConfig(
    history=100,
    classification=ClassificationConfig(
        exemplars_per_state=2, noise_per_state=5, max_exemplars=100, exemplars_alone=20
    ),
)
SMALL_TASK = replace(SMALL, frames="world", clustering=ClusteringConfig(min_examples=4))
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


def birds() -> ModelLearner:
    """A table whose rows are objects that come and go, matched from one step to the next."""
    env = Birds(arrivals=True)
    columns = ("here", "x", "d")
    view = TableView(
        env.observation_space, env.action_space, columns=columns, presence="here", match={"x": 1.0}
    )
    return ModelLearner(env, view=view, config=SMALL, learn_reward=True)


def runners() -> ModelLearner:
    """Agents of two kinds, each with its own action."""
    env = AgentsEnv(Runners(2))
    view = AgentsView(env.observation_space, env.action_space)
    return ModelLearner(env, view=view, config=SMALL, learn_termination=True)


def wheel() -> ModelLearner:
    """An angle that is observed as its cosine and sine, and a post that is never observed."""
    env = Wheel()
    static = (Static("post", {"height": 1.0}),)
    view = NumbersView(env.observation_space, env.action_space, angles=(("x0", "x1"),), static=static)
    return ModelLearner(env, view=view, config=SMALL)


def watched(learner: ModelLearner, episodes: int, length: int) -> tuple[WorldModel, list[Transition]]:
    """A model with all that is known of its env, and the steps it learned from."""
    learner.action_space.seed(0)
    with spied() as steps:
        for seed in range(episodes):
            learner.reset(seed=seed)
            for _ in range(length):
                *_, terminated, truncated, _ = learner.step(learner.action_space.sample())
                if terminated or truncated:
                    break
    objects = Counter((s.before.layout.names, s.after.layout.names) for s in steps).most_common(1)[0][0]
    learner.save(FOLDER / "saved.relgym")  # puts what is known of the env beside the model
    (FOLDER / "saved.relgym").unlink()
    return learner.model, [s for s in steps if (s.before.layout.names, s.after.layout.names) == objects]


def pay() -> tuple[LearnedRewardModel, list[Transition]]:
    """What pushing the puck is paid, and where that ends; the steps are those of its own model."""
    steps = puck(300)
    schema = steps[0].before.schema
    model = LearnedRewardModel(schema, {("self", "x"), ("self", "v")}, SMALL_TASK)
    with spied() as lessons:
        for step in steps:
            x = step.after["self"]["x"]
            model.learn_step(step, 1.0 if x >= 1.9 else -x, terminated=x >= 1.9)
    return model, lessons


def main(names: set[str]) -> None:
    """Write the files of these names, or all."""
    FOLDER.mkdir(exist_ok=True)
    guessing = ModelConfig(features=("trig(x)",), history=400, classification=SMALL.classification)
    plans = {
        "puck": (puck(900), SMALL),
        "lander": (lander(760), guessing),
        "cars": (cars(400), SMALL),
        "discs": (discs(300), SMALL),
    }
    for name, (steps, config) in plans.items():
        if name in names or not names:
            model = WorldModel(steps[0].before.schema, config)
            for step in steps[:-KEPT]:
                model.learn_one(step)
            pushed = spaces.Box(-1.0, 1.0, (1,), np.float64) if ACTION in model.schema.order else None
            keep(name, recorded(model, [step.before for step in steps[:4]], pushed), steps)
    for name, learner in {"birds": birds(), "runners": runners(), "wheel": wheel()}.items():
        if name in names or not names:
            keep(name, *watched(learner, 12, 15))
    if "pay" in names or not names:
        paying, steps = pay()
        paying.save(FOLDER / "pay.relgym")
        keep_steps("pay", steps)
        print(paying.model)


def keep(name: str, model: WorldModel, steps: list[Transition]) -> None:
    """Write a model with and without its history, and the last steps."""
    model.finish()
    model.save(FOLDER / f"{name}.relgym", history=True)
    model.save(FOLDER / f"{name}-frozen.relgym")
    keep_steps(name, steps)
    print(model, model.governed)


def keep_steps(name: str, steps: list[Transition]) -> None:
    """Write the last steps, and which objects are there."""
    scenes = {"before": [s.before for s in steps[-KEPT:]], "after": [s.after for s in steps[-KEPT:]]}
    arrays = {side: np.stack([scene.vector for scene in those]) for side, those in scenes.items()}
    names = {side: list(those[0].layout.names) for side, those in scenes.items()}
    arrays["names"] = np.frombuffer(json.dumps(names).encode(), dtype=np.uint8)
    (FOLDER / f"{name}.npz").write_bytes(write_arrays(arrays))


if __name__ == "__main__":
    main(set(sys.argv[1:]))
