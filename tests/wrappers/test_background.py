"""Learning in a process of its own."""

from __future__ import annotations

import copy
import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carts import run
from gymnasium.vector import SyncVectorEnv
from plain_envs import Slider

from relgym.clustering.features import register_function
from relgym.envs.views import NumbersView
from relgym.errors import ConfigError, ObservationError, RelgymError
from relgym.scene.objects import Transition
from relgym.wrappers import ModelLearner, VectorModelLearner
from relgym.wrappers.background import Background, _registered


def view_of_slider(observation_space: Any, action_space: Any) -> NumbersView:
    return NumbersView(observation_space, action_space, names=("x", "v"))


def test_the_background_learns_the_same_model_and_counts_the_same_errors() -> None:
    here = ModelLearner(Slider(), view=view_of_slider)
    there = ModelLearner(Slider(), view=view_of_slider, background=1000)
    run(here, 80)
    run(there, 80)
    assert there.model.seen == 0  # as of the last catch_up
    assert there.catch_up().to_json(history=True) == here.model.to_json(history=True)
    assert there.dropped == 0
    assert there.prequential.wrong == here.prequential.wrong
    told = [e.model.property_model("self", "v").hindsight.to_json() for e in (here, there)]
    assert told[0] == told[1]
    assert len(told[0]["steps"]) > 40
    twin = copy.deepcopy(there)
    run(there, 10, seed=5)
    there.close()
    assert (there.model.seen, twin.model.seen) == (90, 80)
    twin.reset(seed=0)
    assert twin.step(np.zeros(1))[4]["relgym"].learned is not None  # a copy learns in the foreground


def test_what_finds_the_queue_full_is_dropped_and_counted() -> None:
    env = ModelLearner(Slider(), background=2)
    run(env, 200)
    model = env.catch_up()
    assert env.dropped > 0
    assert model.seen + env.dropped == 200
    env.close()


def test_parcels_lose_nothing_and_what_waits_is_bounded() -> None:
    model = ModelLearner(Slider()).model
    scene = model.schema.scene({"self": [0.0, 0.0], "action": [0.0]})
    background = Background(model, None, queue=400)  # parcels of 6
    for _ in range(20):
        assert background.put(Transition(scene, scene))
    assert background.fetch()[0].seen == 20  # the last parcel isn't full
    os.kill(background._process.pid, signal.SIGSTOP)  # it lives, and learns nothing
    taken = [background.put(Transition(scene, scene)) for _ in range(420)]
    assert (background.sent, background.dropped) == (20 + sum(taken), 420 - sum(taken))
    assert 390 <= sum(taken) <= 400
    assert taken == sorted(taken, reverse=True)
    os.kill(background._process.pid, signal.SIGCONT)
    background.close()


def test_what_made_learning_fail_is_raised_where_it_is_asked_for() -> None:
    model = ModelLearner(Slider()).model
    bad = model.schema.scene({"self": [0.0, 0.0], "action": [0.0]})
    bad.vector.flags.writeable = True
    bad.vector[0] = np.nan
    background = Background(model, None, queue=10)
    assert background.put(Transition(bad, bad))
    with pytest.raises(ObservationError, match="'self', property 'x0': expected a finite number, got nan"):
        background.fetch()
    background.close()


def test_a_process_that_died_is_reported() -> None:
    background = Background(ModelLearner(Slider()).model, None, queue=10)
    background.close()
    with pytest.raises(RelgymError, match="the learning process has ended"):
        background.fetch()
    with pytest.raises(ConfigError, match="background=0: expected a whole number"):
        ModelLearner(Slider(), background=0)


class Closing(Slider):
    closed = False

    def close(self) -> None:
        self.closed = True


def killed(env: Any) -> None:
    process = env._observer.study._background._process
    process.terminate()
    process.join()


def test_closing_over_a_dead_process_says_so_and_closes_all() -> None:
    inner = Closing()
    env = ModelLearner(inner, background=10)
    killed(env)
    with pytest.raises(RelgymError, match="the learning process has ended"):
        env.close()
    assert inner.closed
    env.close()  # nothing is left to end
    inner.closed = False
    envs = VectorModelLearner(SyncVectorEnv([lambda: inner]), background=10)
    killed(envs)
    with pytest.raises(RelgymError, match="the learning process has ended"):
        envs.close()
    assert inner.closed


def test_a_dead_process_ends_acting_in_vain() -> None:
    """Not from the first step on where several are sent at a time, but soon."""
    env = ModelLearner(Slider(), background=400)
    run(env, 10)
    killed(env)
    with pytest.raises(RelgymError, match=r"the learning process has ended.*close\(\) goes on without it"):
        run(env, 10)
    assert env.dropped == 0
    with pytest.raises(RelgymError):
        env.close()
    run(env, 5)  # in the foreground
    assert env.model.seen == 5


def test_what_makes_learning_fail_is_said_soon() -> None:
    model = ModelLearner(Slider()).model
    bad = model.schema.scene({"self": [0.0, 0.0], "action": [0.0]})
    bad.vector.flags.writeable = True
    bad.vector[0] = np.nan
    background = Background(model, None, queue=10)
    assert background.put(Transition(bad, bad))
    until(lambda: not background._inbox.empty())
    for _ in range(2):
        with pytest.raises(ObservationError, match="got nan"):
            background.put(Transition(bad, bad))
    assert (background.sent, background.dropped) == (1, 0)
    background.close()


def test_what_was_dropped_is_known_after_the_end() -> None:
    env = ModelLearner(Slider(), background=1)
    run(env, 100)
    env.catch_up()
    dropped = env.dropped
    env.close()
    assert env.dropped == dropped > 0
    assert env.model.seen + env.dropped == 100


def test_nothing_is_sent_while_learning_is_paused() -> None:
    env = ModelLearner(Slider(), background=100)
    run(env, 10)
    env.pause()
    run(env, 10)
    env.close()
    assert (env.model.seen, env.prequential.steps) == (10, 10)


# ---------------------------------------------------------------------- functions of the user's
def halved(x: Any) -> Any:
    return x / (1.0 + np.abs(x))


def test_registered_functions_are_known_in_the_background() -> None:
    register_function("halved", halved)
    here, there = (
        ModelLearner(Slider(), config={"features": ("halved",)}, background=queue) for queue in (None, 1000)
    )
    run(here, 40)
    run(there, 40)
    assert there.catch_up().to_json(history=True) == here.model.to_json(history=True)
    there.close()


def test_functions_that_no_process_can_be_sent_are_refused() -> None:
    register_function("local", lambda x: x)
    with pytest.raises(ConfigError, match=r"\['local'\] can't be sent.*top level.*background=None"):
        ModelLearner(Slider(), config={"features": ("local",)}, background=10)
    assert ModelLearner(Slider(), config={"features": ("local",)}).model.seen == 0
    assert ModelLearner(Slider(), config={"features": ("trig",)}).model.seen == 0


def test_a_function_that_another_process_cannot_find_is_reported() -> None:
    trouble = _registered(b"cno_such_module\nf\n.")
    assert isinstance(trouble, ConfigError)
    with pytest.raises(ConfigError, match=r"outside of `if __name__ == '__main__':`"):
        raise trouble


# ---------------------------------------------------------------------- how it ends, and what an interrupt leaves
PARENT = """
import sys, threading, time
import numpy as np
sys.path[:0] = {paths!r}
from plain_envs import Slider
from relgym.wrappers import ModelLearner

def main():
    env = ModelLearner(Slider(), background=100)
    print(env._observer.study._background._process.pid, flush=True)
    env.reset(seed=0)
    while True:
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
        {do}

if __name__ == "__main__":
    main()
"""


def until(condition: Any, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    state = Path(f"/proc/{pid}/stat")
    return state.exists() and state.read_text().rpartition(")")[2].split()[0] == "Z"


def parent(tmp_path: Path, do: str = "pass") -> tuple[subprocess.Popen[str], int]:
    """A process that learns in the background, and the learning process' id."""
    script = tmp_path / "parent.py"
    script.write_text(PARENT.format(paths=[p for p in sys.path if p], do=do))
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    with process.stdout as said:
        return process, int(said.readline())


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signals")
@pytest.mark.parametrize("how", ["SIGKILL", "SIGTERM", "exit", "error"])
def test_the_process_ends_with_its_parent_however_that_ends(how: str, tmp_path: Path) -> None:
    do = {"exit": "sys.exit()", "error": "raise ValueError"}.get(how, "pass")
    process, child = parent(tmp_path, do)
    if how.startswith("SIG"):
        process.send_signal(getattr(signal, how))
    process.wait(60.0)
    until(lambda: gone(child), 20.0)


@pytest.mark.slow
def test_a_hundred_killed_parents_leave_no_process(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    longest = 0.0
    for _ in range(int(os.environ.get("RELGYM_KILLS", "100"))):
        process, child = parent(tmp_path)
        time.sleep(float(rng.uniform(0.0, 3.0)))
        process.kill()
        process.wait()
        begin = time.monotonic()
        until(lambda pid=child: gone(pid), 20.0)  # type: ignore[misc]
        longest = max(longest, time.monotonic() - begin)
    print(f"longest: {longest:.2f} s")
    overloaded = os.getloadavg()[0] > 2 * (
        os.cpu_count() or 1
    )  # a process that only just starts takes its time
    assert longest < (20.0 if overloaded else 5.0)


def test_it_ends_when_it_is_deleted() -> None:
    env = ModelLearner(Slider(), background=10)
    run(env, 5)
    process = env._observer.study._background._process
    del env
    gc.collect()
    assert process.exitcode is not None


@pytest.mark.skipif(os.name != "posix", reason="interrupts differ there")
def test_an_interrupt_loses_nothing() -> None:
    here, there = ModelLearner(Slider()), ModelLearner(Slider(), background=1000)
    run(here, 60)
    process = there._observer.study._background._process
    os.kill(process.pid, signal.SIGINT)  # while it starts
    run(there, 60)
    os.kill(process.pid, signal.SIGINT)
    signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.001)
    try:
        with pytest.raises(KeyboardInterrupt):  # while it waits for an answer
            while True:
                there.catch_up()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
    assert there.catch_up().to_json(history=True) == here.model.to_json(history=True)
    there.close()


def interrupt(number: int, frame: Any) -> None:
    raise KeyboardInterrupt


def test_a_parcel_that_was_sent_twice_is_learned_once() -> None:
    model = ModelLearner(Slider()).model
    scene = model.schema.scene({"self": [0.0, 0.0], "action": [0.0]})
    background = Background(model, None, queue=400)
    for _ in range(5):
        background.put(Transition(scene, scene))
    sent = background._parcel
    assert background.fetch()[0].seen == 5
    background._parcel = sent  # as if it had been interrupted
    assert background.put(Transition(scene, scene))
    assert background.fetch()[0].seen == 6
    background.close()


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_it_learns_in_children_of_other_start_methods(method: str) -> None:
    context = multiprocessing.get_context(method)
    answers, remote = context.Pipe(duplex=False)
    process = context.Process(target=learn_elsewhere, args=(remote,), daemon=False)
    process.start()
    assert answers.poll(120.0)
    assert answers.recv() == 20
    process.join()


def learn_elsewhere(answers: Any) -> None:
    env = ModelLearner(Slider(), background=100)
    run(env, 20)
    answers.send(env.catch_up().seen)
    env.close()


def test_a_worker_that_may_have_no_children_is_told() -> None:
    context = multiprocessing.get_context("spawn")
    answers, remote = context.Pipe(duplex=False)
    process = context.Process(target=refused_elsewhere, args=(remote,), daemon=True)
    process.start()
    assert answers.poll(120.0)
    assert "daemonic worker" in answers.recv()
    process.join()


def refused_elsewhere(answers: Any) -> None:
    try:
        ModelLearner(Slider(), background=100)
    except ConfigError as error:
        answers.send(str(error))


@pytest.mark.slow
def test_it_learns_in_a_notebook_and_an_interrupt_of_a_cell_loses_nothing() -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    cells = [
        "import gymnasium as gym, relgym, os, signal\n"
        "env = relgym.wrappers.ModelLearner(gym.make('CartPole-v1'), background=1000)\n"
        "_ = env.reset(seed=0)",
        "for _ in range(8):\n    env.step(0)",
        "try:\n    os.killpg(0, signal.SIGINT)\n    import time; time.sleep(10)\n"
        "except KeyboardInterrupt:\n    pass",
        "env.catch_up().seen",
    ]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    done = nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    assert done.cells[-1].outputs[0]["data"]["text/plain"] == "8"
