"""Every parameter of Dyna is checked, and the message says what is expected."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from relgym.errors import ConfigError
from relgym.wrappers.dyna.config import DynaConfig


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"real_ratio": 1.5}, "real_ratio=1.5: expected a share from 0 to 1"),
        ({"from_start": -0.1}, "from_start=-0.1: expected a share"),
        ({"perturb_velocity": 1.5}, "perturb_velocity=1.5: expected a share"),
        ({"horizon": 0}, "horizon=0: expected a whole number, at least 1"),
        ({"horizon": 2.5}, "horizon=2.5: expected a whole number"),
        ({"dreams": True}, "dreams=True: expected a whole number"),
        ({"least": 200}, "least=200: expected at most window=100"),
        ({"accept_at": 0.3}, "expected 0 <= accept_at <= reject_at"),
        ({"reject_at": float("inf")}, "expected 0 <= accept_at <= reject_at"),
        ({"accept_at": "a"}, "expected 0 <= accept_at <= reject_at"),
        ({"perturb_velocity": "a"}, "perturb_velocity='a': expected a share"),
        ({"real_ratio": None}, "real_ratio=None: expected a share"),
    ],
)
def test_illegal_values(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        DynaConfig(**changes)


def test_numpys_numbers_are_numbers() -> None:
    assert DynaConfig(dreams=np.int64(4), perturb_velocity=np.float64(0.5)).dreams == 4  # type: ignore[arg-type]


def test_the_package_loads_without_torch() -> None:
    import subprocess
    import sys

    code = (
        "import relgym.wrappers.sb3 as s, sys; s.DynaConfig; s.TransitionRecorder; s.ModelAcceptance; s.SceneStock; "
        "assert 'Dyna' in dir(s); print([n for n in ('torch', 'stable_baselines3') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
