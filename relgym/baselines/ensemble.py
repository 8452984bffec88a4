"""An ensemble of multilayer perceptrons, the usual learned model of deep model-based RL (needs torch).

After PETS (Chua et al. 2018, *Deep Reinforcement Learning in a Handful of Trials*) and MBPO (Janner et al. 2019,
*When to Trust Your Model*), reduced to what small worlds need: members differ in their first weights and in the
bootstrap sample each sees, and their mean is the prediction.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relgym.errors import ConfigError, QueryError

__all__ = ["MLPEnsemble"]


class MLPEnsemble:
    """Learns a function from d features to m values with several small nets.

    Features and values are standardised by what was seen so far. After every `train_every` examples each
    member takes `train_steps` steps of Adam on batches from its own bootstrap sample.

    Parameters
    ----------
    members
        Number of nets, >= 1.
    hidden
        Width of the two hidden layers (SiLU).
    train_every
        Examples between two trainings, >= 1.
    train_steps
        Gradient steps of each training. Raising it costs time and fits more closely.
    batch_size
        Examples per gradient step and member.
    learning_rate, weight_decay
        Adam's, and the decoupled penalty on large weights.
    seed
        Of weights, bootstrap samples and batches.

    Notes
    -----
    Cost of a training: `train_steps` forward and backward passes of all members at once, O(members *
    batch_size * hidden^2) each.

    Deviation from PETS: members give a mean, no variance, and predictions are the members' mean, so that the
    same question always has the same answer.
    """

    def __init__(
        self,
        *,
        members: int = 5,
        hidden: int = 64,
        train_every: int = 50,
        train_steps: int = 200,
        batch_size: int = 128,
        learning_rate: float = 1e-3,
        weight_decay: float = 1e-5,
        seed: int = 0,
    ) -> None:
        counts = {"members": members, "hidden": hidden, "train_every": train_every, "batch_size": batch_size}
        for name, count in counts.items():
            if count < 1:
                raise ConfigError(f"{name}={count!r}: expected at least 1")
        self.members, self.hidden = members, hidden
        self.train_every, self.train_steps, self.batch_size = train_every, train_steps, batch_size
        self.learning_rate, self.weight_decay = learning_rate, weight_decay
        self._rng = np.random.default_rng(seed)
        self._seed = seed
        self._x: list[NDArray[np.float64]] = []
        self._y: list[NDArray[np.float64]] = []
        self._weights = np.empty((members, 0))  # how often each member's bootstrap sample holds an example
        self._net: Any = None
        self._optimizer: Any = None
        self._shift: dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]] = {}

    @property
    def seen(self) -> int:
        """Number of examples learned from."""
        return len(self._x)

    @property
    def ready(self) -> bool:
        """Whether the nets have been trained."""
        return self._net is not None

    def learn_one(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
        """Take up one example: features of shape ``(d,)``, values of shape ``(m,)``; train when it is time."""
        self._x.append(np.asarray(x, dtype=np.float64))
        self._y.append(np.asarray(y, dtype=np.float64))
        if self.seen % self.train_every == 0:
            self._train()

    def predict_one(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of one row of features, shape ``(m,)``; `QueryError` before the first training."""
        found: NDArray[np.float64] = self.predict_batch(np.asarray(x)[None])[0]
        return found

    def predict_batch(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values of rows of features of shape ``(n, d)``, shape ``(n, m)``; `QueryError` before the first training."""
        import torch

        if self._net is None:
            raise QueryError(f"not trained yet: learn from {self.train_every} examples first")
        rows = torch.as_tensor(self._standard("x", x), dtype=torch.float32)
        with torch.no_grad():
            mean = self._net(rows.expand(self.members, *rows.shape)).mean(dim=0)
        middle, spread = self._shift["y"]
        found: NDArray[np.float64] = mean.numpy().astype(np.float64) * spread + middle
        return found

    # ------------------------------------------------------------------ training
    def _train(self) -> None:
        import torch

        x, y = np.stack(self._x), np.stack(self._y)
        for name, rows in (("x", x), ("y", y)):
            spread = rows.std(axis=0)
            self._shift[name] = (rows.mean(axis=0), np.where(spread > 1e-12, spread, 1.0))
        self._extend_bootstrap(len(x))
        if self._net is None:
            self._build(x.shape[1], y.shape[1])
        inputs = torch.as_tensor(self._standard("x", x), dtype=torch.float32)
        wanted = torch.as_tensor(self._standard("y", y), dtype=torch.float32)
        chances = self._weights / self._weights.sum(axis=1, keepdims=True)
        for _ in range(self.train_steps):
            drawn = np.stack([self._rng.choice(len(x), self.batch_size, p=p) for p in chances])
            loss = ((self._net(inputs[drawn]) - wanted[drawn]) ** 2).mean(dim=(1, 2)).sum()
            self._optimizer.zero_grad()
            loss.backward()
            self._optimizer.step()

    def _extend_bootstrap(self, count: int) -> None:
        """Poisson(1) copies of every new example for each member: an online bootstrap (Oza & Russell 2001)."""
        new = self._rng.poisson(1.0, (self.members, count - self._weights.shape[1])).astype(np.float64)
        self._weights = np.concatenate([self._weights, new], axis=1)

    def _build(self, inputs: int, outputs: int) -> None:
        import torch

        generator = torch.Generator().manual_seed(self._seed)
        self._net = _stacked_net(self.members, (inputs, self.hidden, self.hidden, outputs), generator)
        self._optimizer = torch.optim.AdamW(
            self._net.parameters(), lr=self.learning_rate, weight_decay=self.weight_decay
        )

    def _standard(self, name: str, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        middle, spread = self._shift[name]
        standard: NDArray[np.float64] = (rows - middle) / spread
        return standard


def _stacked_net(members: int, sizes: tuple[int, ...], generator: Any) -> Any:
    """All members as one net on arrays of shape ``(members, n, d)``."""
    import torch

    class Linear(torch.nn.Module):  # type: ignore[misc]
        def __init__(self, inputs: int, outputs: int) -> None:
            super().__init__()
            bound = inputs**-0.5
            weight = (2.0 * torch.rand(members, inputs, outputs, generator=generator) - 1.0) * bound
            self.weight = torch.nn.Parameter(weight)
            self.bias = torch.nn.Parameter(torch.zeros(members, 1, outputs))

        def forward(self, x: Any) -> Any:
            return torch.baddbmm(self.bias, x, self.weight)

    layers: list[Any] = []
    for inputs, outputs in itertools.pairwise(sizes):
        layers += [Linear(inputs, outputs), torch.nn.SiLU()]
    return torch.nn.Sequential(*layers[:-1])
