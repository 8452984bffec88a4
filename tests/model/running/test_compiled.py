"""The kernel is loaded off the step, once it pays; who can't have it is told so once."""

from __future__ import annotations

from collections.abc import Callable
from threading import Event

import pytest

from relgym.errors import SlowWarning
from relgym.model.running import compiled
from relgym.model.running.compiled import KERNEL, Kernel


def test_the_kernel_is_loaded_off_the_step_once_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    going, made = Event(), KERNEL.load()

    def slowly() -> object:
        assert going.wait(60.0)
        return made

    monkeypatch.setattr(compiled, "make", slowly)
    kernel = Kernel()
    assert kernel.after(1) is None and kernel.spent > 0.0 and kernel._loader is None
    many = int(1.01 * compiled.LOADING / compiled.SCENE)
    assert kernel.after(many) is None  # a thread has begun
    assert kernel._loader is not None and kernel.after(1) is None
    going.set()
    kernel._loader.join()
    assert kernel.after(1) is kernel.machine is made is not None


def test_who_wants_it_now_waits_for_it() -> None:
    kernel = Kernel()
    assert kernel.load() is not None
    assert kernel.after(1) is kernel.load() is kernel.machine


def refused() -> None:
    raise ImportError("No module named 'llvmlite'")


@pytest.mark.parametrize(("make", "why"), [(refused, "pip install llvmlite"), (lambda: None, "be compiled")])
def test_who_cannot_have_it_is_told_so_once(
    monkeypatch: pytest.MonkeyPatch, make: Callable[[], None], why: str
) -> None:
    monkeypatch.setattr(compiled, "make", make)
    kernel = Kernel()
    assert kernel.after(int(1.01 * compiled.LOADING / compiled.SCENE)) is None
    assert kernel._loader is not None
    kernel._loader.join()
    with pytest.warns(SlowWarning, match=why):
        assert kernel.after(1) is None
    assert kernel.after(1) is None  # a second warning would be an error
    assert kernel.load() is None
