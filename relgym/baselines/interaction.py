"""An interaction network (Battaglia et al., 2016): what each object does to the target, summed (needs torch)."""

from __future__ import annotations

from typing import Any

import numpy as np

from relgym.baselines.base import Float1D, Float2D, Memory
from relgym.errors import ConfigError, QueryError

__all__ = ["InteractionNetwork"]


class InteractionNetwork:
    """One net for the effect of an object on the target, one for what follows from their sum.

    A row of features is the target's own numbers, then equally many for every other object. All objects go through the
    same net, so that their order means nothing.

    Parameters
    ----------
    own
        How many columns at the beginning are the target's own.
    objects
        How many other objects follow.
    hidden
        Width of the hidden layers and of effects.
    train_every
        Examples between two trainings.
    train_steps
        Steps of Adam in each.
    learning_rate
        Adam's.
    seed
        Of weights and batches.

    Raises
    ------
    ConfigError
        No other objects, or a number below 1.
    """

    def __init__(
        self,
        own: int,
        objects: int,
        *,
        hidden: int = 64,
        train_every: int = 200,
        train_steps: int = 100,
        learning_rate: float = 1e-3,
        seed: int = 0,
    ) -> None:
        counts = {"own": own, "objects": objects, "hidden": hidden, "train_every": train_every}
        for name, count in counts.items():
            if count < 1:
                raise ConfigError(f"{name}={count!r}: expected at least 1")
        self.own, self.objects, self.hidden = own, objects, hidden
        self.train_every, self.train_steps, self.learning_rate = train_every, train_steps, learning_rate
        self._seed, self._rng = seed, np.random.default_rng(seed)
        self._memory = Memory()
        self._shift: dict[str, tuple[Float1D, Float1D]] = {}
        self._nets: tuple[Any, Any] | None = None
        self._optimizer: Any = None

    def learn_one(self, x: Float1D, y: Float1D) -> None:
        """Take up one example; train when it is time.

        Raises
        ------
        ConfigError
            The columns behind the target's own can't be shared out among the objects.
        """
        if (len(x) - self.own) % self.objects:
            raise ConfigError(f"{len(x) - self.own} columns can't be shared out among {self.objects} objects")
        self._memory.add(x, y)
        if len(self._memory) % self.train_every == 0:
            self._train()

    def predict_one(self, x: Float1D) -> Float1D:
        """Values of one row, shape ``(m,)``; `QueryError` before the first training."""
        values: Float1D = self.predict_batch(x[None])[0]
        return values

    def predict_batch(self, x: Float2D) -> Float2D:
        """Values of rows of shape ``(n, d)``, shape ``(n, m)``; `QueryError` before the first training."""
        import torch

        if self._nets is None:
            raise QueryError(f"not trained yet: learn from {self.train_every} examples first")
        with torch.no_grad():
            found = self._forward(torch.as_tensor(self._standard("x", x), dtype=torch.float32))
        middle, spread = self._shift["y"]
        values: Float2D = found.numpy().astype(np.float64) * spread + middle
        return values

    def _standard(self, name: str, rows: Float2D) -> Float2D:
        middle, spread = self._shift[name]
        standard: Float2D = (rows - middle) / spread
        return standard

    def _forward(self, rows: Any) -> Any:
        import torch

        assert self._nets is not None, "asked after it was built"
        effect, outcome = self._nets
        target = rows[:, : self.own]
        others = rows[:, self.own :].reshape(len(rows), self.objects, -1)
        pairs = torch.cat([target[:, None].expand(-1, self.objects, -1), others], dim=2)
        return outcome(torch.cat([target, effect(pairs).sum(dim=1)], dim=1))

    def _train(self) -> None:
        import torch

        x, y = self._memory.x, self._memory.y
        # Objects share their nets, hence their scale.
        blocks = x[:, self.own :].reshape(len(x) * self.objects, -1)
        middle, spread = (np.tile(found, self.objects) for found in _moments(blocks))
        own_middle, own_spread = _moments(x[:, : self.own])
        self._shift["x"] = np.append(own_middle, middle), np.append(own_spread, spread)
        self._shift["y"] = _moments(y)
        if self._nets is None:
            self._build(blocks.shape[1], y.shape[1])
        inputs = torch.as_tensor(self._standard("x", x), dtype=torch.float32)
        wanted = torch.as_tensor(self._standard("y", y), dtype=torch.float32)
        for _ in range(self.train_steps):
            drawn = self._rng.integers(len(x), size=128)
            loss = ((self._forward(inputs[drawn]) - wanted[drawn]) ** 2).mean()
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()

    def _build(self, each: int, outputs: int) -> None:
        import torch

        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self._seed)
            self._nets = (
                _net(self.own + each, self.hidden, self.hidden),
                _net(self.own + self.hidden, self.hidden, outputs),
            )
        weights = [p for net in self._nets for p in net.parameters()]
        self._optimizer = torch.optim.Adam(weights, lr=self.learning_rate)


def _net(inputs: int, hidden: int, outputs: int) -> Any:
    from torch import nn

    return nn.Sequential(nn.Linear(inputs, hidden), nn.SiLU(), nn.Linear(hidden, outputs))


def _moments(rows: Float2D) -> tuple[Float1D, Float1D]:
    """Mean and standard deviation by column; 1 where nothing varied."""
    spread = rows.std(axis=0)
    return rows.mean(axis=0), np.where(spread > 1e-12, spread, 1.0)
