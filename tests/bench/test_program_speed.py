"""What a compiled program costs: a single scene (at most 30 µs), lowering it, and the kernel from its cache."""

from __future__ import annotations

import itertools
import subprocess
import sys

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from relgym.experiments.dyna.speed import WORLDS, dreams
from relgym.model.running.compiled import KERNEL
from relgym.model.running.lowering import lowered
from relgym.model.world_model import WorldModel
from relgym.program.tape import encoded
from relgym.scene.objects import Scene


def scenes(world: str) -> tuple[WorldModel, list[Scene]]:
    KERNEL.load()
    envs = dreams(world)
    envs.reset(seed=0)
    shown = envs._setting.shown
    action = envs.single_action_space.sample()
    return envs.model, [shown.acting(scene, action) for scene in envs.scenes[:200]]


@pytest.mark.parametrize("world", WORLDS)
def test_one_scene(benchmark: BenchmarkFixture, world: str) -> None:
    model, some = scenes(world)
    for scene in some[:20]:
        model.predict_one(scene)
    turn = itertools.cycle(some)
    benchmark.pedantic(lambda: model.predict_one(next(turn)), rounds=200, iterations=20)


@pytest.mark.parametrize("world", WORLDS)
def test_lowering(benchmark: BenchmarkFixture, world: str) -> None:
    model, some = scenes(world)
    benchmark(lambda: encoded(lowered(model._parts, some[0].layout)))


def test_the_kernel_from_its_cache(benchmark: BenchmarkFixture) -> None:
    code = (
        "import numpy as np, relgym, time\n"
        "from relgym.scene.objects import ObjectType\n"
        "from relgym.scene.schema import SceneSchema\n"
        "from relgym.model.running.compiled import KERNEL\n"
        "KERNEL.load()\n"
        "s = SceneSchema((ObjectType('b', ('v',)),), (('b', 'b'),))\n"
        "v = np.linspace(1.0, 9.0, 40)[:, None]\n"
        "relgym.WorldModel(s).fit(v, next_observations=0.5 * v).predict_batch(s.layout(), v)"
    )
    command = [sys.executable, "-c", code]
    benchmark.pedantic(subprocess.run, args=(command,), kwargs={"check": True}, rounds=5, warmup_rounds=1)
