"""What a graphics card is given says what the kernel says: run by the processor, and by a card where there is one."""

from __future__ import annotations

import ctypes
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest
from numpy.typing import NDArray
from programs import MODELS, looked_back, runner, scenes_of

from relgym.errors import ConfigError
from relgym.model.running.compiled import KERNEL
from relgym.model.running.runner import Runner
from relgym.model.world_model import WorldModel
from relgym.program import gpu
from relgym.program.gpu import Card, CardError, ptx, roomy
from relgym.program.machine import _optimized, _target
from relgym.program.tape import Sizes
from relgym.scene.objects import ACTION


def _no_card() -> str:
    try:
        gpu._library()
    except CardError as error:
        return str(error)
    return ""


NO_CARD = _no_card()
needs_card = pytest.mark.skipif(bool(NO_CARD), reason=NO_CARD)


class Imitation(Card):
    """The very assembly that cards get, compiled for this processor, one thread after the other."""

    def __init__(self, sizes: Sizes) -> None:
        self.sizes = roomy(sizes)
        module, target = _optimized(gpu.text(self.sizes, 0), _target())
        self._engine = llvm.create_mcjit_compiler(module, target)
        self._engine.finalize_object()
        self._space = np.zeros(1, gpu.own_space(self.sizes))

    def call(self, name: str, *arguments: Any) -> int:
        kinds = [ctypes.c_int64 if isinstance(a, int | np.integer) else ctypes.c_void_p for a in arguments]
        function = ctypes.CFUNCTYPE(ctypes.c_int64, *kinds)(self._engine.get_function_address(name))
        given = [a if isinstance(a, int | np.integer) else a.ctypes.data for a in arguments]
        return int(function(*given))

    def _lay(self, tape: tuple[NDArray[np.int64], NDArray[np.float64]]) -> None:
        for name, part in zip(("relgym_code", "relgym_numbers"), tape, strict=True):
            ctypes.memmove(self._engine.get_global_value_address(name), part.ctypes.data, part.nbytes)
        self._space[:] = 0
        self.call("relgym_forget", self._space)

    def _rolled(self, vectors: Any, steps: int, actions: Any, first: int, settling: bool) -> Any:
        after, lasted, n = np.empty(vectors.shape), np.empty(len(vectors), np.int64), len(vectors)
        actions = np.ascontiguousarray(actions)
        for i in range(n):
            numbers = 1, n, steps, int(settling), first, actions.shape[-1]
            taken = actions.reshape(-1)[i * actions.shape[-1] :]
            self.call("relgym_roll", self._space, *numbers, taken, vectors[i], after[i], lasted[i:])
        return after, lasted

    def _ran(self, vectors: Any, following: Any, told: Any, settling: bool) -> int:
        outcomes, modes, margins, sure = told
        known, wrong = np.empty((len(vectors), 2, outcomes.shape[1])), 0
        for i in range(len(vectors)):
            places = vectors[i], following[i], outcomes[i], modes[i], margins[i], known[i]
            wrong |= self.call("relgym_run", self._space, 1, int(settling), 0, 1, *places)
        if settling:
            sure[:] = known.swapaxes(0, 1)
        return wrong


@pytest.fixture
def imitated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(KERNEL, "_card", None)
    monkeypatch.setattr("relgym.model.running.compiled.Card", Imitation)


def assert_same(asked: Runner, vectors: NDArray[np.float64]) -> None:
    """A card says what the processor says; sines may differ in the last place."""
    said, known = asked.many(vectors, on_card=True), asked.many(vectors)
    assert said is not None and known is not None
    for name in ("outcomes", "modes", "margins", "probabilities", "intervals"):
        np.testing.assert_array_equal(getattr(said, name), getattr(known, name))
    np.testing.assert_allclose(said.vectors, known.vectors, rtol=1e-12, atol=1e-12)
    nothing = np.empty((7, len(vectors), 0))
    came, comes = (asked.roll(vectors, 7, nothing, 0, on_card=on_card) for on_card in (True, False))
    assert came is not None and comes is not None
    np.testing.assert_array_equal(came.lasted, comes.lasted)
    np.testing.assert_allclose(came.vectors, comes.vectors, rtol=1e-12, atol=1e-12)


def asked_of(model: WorldModel) -> tuple[Runner, NDArray[np.float64]]:
    layout, vectors = scenes_of(model, 60)
    return runner(model._parts, layout), np.ascontiguousarray(vectors)


@pytest.mark.parametrize("name", MODELS)
def test_what_it_is_given(name: str, imitated: None) -> None:
    for model in (MODELS[name](), looked_back(MODELS[name](), 1)):
        assert_same(*asked_of(model))


@needs_card
@pytest.mark.parametrize("name", MODELS)
def test_what_a_card_says(name: str) -> None:
    for model in (MODELS[name](), looked_back(MODELS[name](), 1)):
        assert_same(*asked_of(model))


def test_scenes_go_there_a_part_at_a_time(imitated: None, monkeypatch: pytest.MonkeyPatch) -> None:
    asked, vectors = asked_of(MODELS["cart"]())
    where = asked._layout.slice(asked._layout.index(ACTION))
    actions = np.random.default_rng(0).uniform(0.0, 10.0, size=(5, len(vectors), where.stop - where.start))
    whole = asked.roll(vectors, 5, actions, where.start)
    monkeypatch.setattr(gpu, "MANY", 7)
    parts = asked.roll(vectors, 5, actions, where.start, on_card=True)
    assert whole is not None and parts is not None
    np.testing.assert_array_equal(parts.vectors, whole.vectors)
    np.testing.assert_array_equal(parts.lasted, whole.lasted)
    said, known = asked.many(vectors, on_card=True), asked.many(vectors)
    assert said is not None and known is not None
    np.testing.assert_array_equal(said.vectors, known.vectors)
    np.testing.assert_array_equal(said.outcomes, known.outcomes)
    nobody = asked.roll(vectors[:0], 5, actions[:, :0], where.start, on_card=True)
    assert nobody is not None and nobody.vectors.shape == (0, vectors.shape[1])


def test_a_larger_program_gets_a_kernel_of_its_own(imitated: None) -> None:
    sizes = asked_of(MODELS["cart"]())[0]._sizes
    card = KERNEL.card(sizes)
    assert KERNEL.card(sizes) is card
    assert KERNEL.card(sizes._replace(answers=2 * card.sizes.answers)) is not card


def test_sizes_are_rounded_up() -> None:
    some = roomy(Sizes(*range(15)))
    assert some == (1, 1, 2, 4, 4, 8, 8, 8, 8, 16, 16, 16, 16, 16, 16)
    assert all(size <= most for size, most in zip(range(15), some, strict=True))


def test_nothing_is_contracted() -> None:
    """Products and sums are rounded one after the other, as the processor does."""
    text = ptx(roomy(Sizes(*(4,) * 15)))
    assert ".entry relgym_roll_each" in text and ".entry relgym_run_each" in text
    assert "fma" not in text
    rounded = [
        line.split()[0] for line in text.splitlines() if line.split()[:1] and ".f64" in line.split()[0]
    ]
    found = {word for word in rounded if word.split(".")[0] in ("add", "sub", "mul", "div", "sqrt")}
    assert found and all(".rn." in word for word in found)


@pytest.mark.skipif(not NO_CARD, reason="there is a card")
def test_without_a_card_it_is_said_what_to_do() -> None:
    model = MODELS["cart"]()
    layout, vectors = scenes_of(model, 3)
    with pytest.raises(ConfigError, match=r"device=.cuda.: .*(cupy|card)"):
        model.rollout_batch(layout, vectors, 2, device="cuda")
    with pytest.raises(ConfigError, match=r"device=.cuda.: .*(cupy|card)"):
        model.predict_batch(layout, vectors, device="cuda")
