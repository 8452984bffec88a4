"""All parameters of a model in one record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from relgym.arguments import refusing_fields
from relgym.config.checks import at_least, at_most, one_of, plain
from relgym.config.classification import ClassificationConfig
from relgym.config.clustering import ClusteringConfig
from relgym.errors import ConfigError

__all__ = ["ModelConfig"]


@refusing_fields(ConfigError)
@dataclass(frozen=True, slots=True)
class ModelConfig:
    """All free parameters of a `WorldModel`; one default for every env.

    Parameters
    ----------
    clustering, classification
        Parameters of the two halves of the learner.
    seed
        Seed of everything random. The same transitions and the same config give a byte-identical model.
    geometry
        ``"arrays"`` (default, batched) or ``"fcl"`` (any shapes, scene by scene); a model always uses the same one.
    abstain
        Whether a situation that differs from all seen ones in what the clauses look at is called *outside experience*
        instead of being predicted, and one where no mode explained what followed *unexplained*
        (`relgym.model.target.scope`). Default true; false: the votes decide there as everywhere.
    cells_per_step
        What each transition earns for searches (for modes, approximations, causal order, guesses and clauses), in
        cells: numbers looked at, of which a thousand million take one to four seconds. Default 250,000, 1 ms at most,
        range 1 to 10**15. A search that takes more than there is goes on after the next
        transitions. Raising it finds sooner what is hard to find and makes every step of a world that isn't
        understood slower.
    most_cells
        Largest number of cells that one transition spends; the last piece of work may overdraw it. Default 7,500,000,
        15 to 30 ms, so that no step takes longer than a frame at 25 Hz.
    saved_cells
        Cells that are saved for later where nothing is to be searched, and that there are to begin with. Default
        1,000,000,000, 4 s at most: worlds that can be understood are, before it is spent.
    frames
        Axes in which velocities are described. ``"auto"`` (default): laws of motion, stated in the frame of a contact
        or another one that the scene offers, for those types whose transitions they describe in fewer bits than modes
        do. ``"world"``: modes along the world's axes for everything, as in the thesis.
    features
        Non-linear features offered beside the properties (§5.1): ``"trig"`` (sines and cosines at frequencies 1 to 3
        of the type's angles, or else of all the target's own properties; ``"trig(th)"``: of that one), ``"squares"``,
        ``"products"``, ``"degree3"``, ``"degree4"`` (of properties, and of sines and cosines if there are any), and
        names of functions registered with `relgym.clustering.features.register_function`. ``"cart:trig"`` offers them
        to one type only. Default none; where linear laws don't explain a property, the report says what would.
        A linear law wins where it is enough; every kind offered makes searches slower.
    hypotheses
        Names of classes registered with `relgym.hypotheses.register_hypothesis`, whose laws compete with modes for
        every property. Default none; each costs the time of its proposals, and speaks only where it codes what comes
        better than anybody else.
    history
        Examples kept per object type; memory stays flat beyond. Default 200,000, range 100 to 10**9. Of more, a uniform
        choice stays, and everything rare: small modes, recent noise, and what classifiers remember. Raising it costs
        memory (some 100 bytes an example and upwards), lowering it makes late discoveries rest on fewer examples.
    claim_error
        By how much what is claimed may be off, as a share of the median of what the property changes by where it
        changes. Default 0.05, range (0, 1]. Raising it claims approximations, too; lowering it claims exact laws alone.
    claim_probability
        How probable it must be, after how such predictions came out, that a prediction is no further off than that,
        for it to be claimed (`Prediction.ok`). Default 0.5, range (0, 1]: more likely right than not. Raising it doubts
        what is seldom and unsure, too. It counts only where predictions are looked back at, as wrappers and
        `WorldModel.fit` do.
    claim_slips
        Share of a property's predictions that may be expected to be claimed and off. The surest kinds of predictions
        are claimed first, as many as that allows. Default 0.0075, range (0, 1]: less than a per cent, with a margin for
        what is learned of the kinds meanwhile. Raising it claims more, and more of that is off.
    downsampling
        Predictions that come true teach little, so some of them are left out, and those that are learned from count for
        them, too: after r in a row of one kind one of ``2 * downsampling * r`` is learned from, if that is 2 or more
        (rounded down). Half of one in r is what is then expected to fail, so that an exception is no larger a share of
        what was learned from since the one before than this, unless it came sooner. Default 0.0075, as large a share
        as claims may be off in: all of the first 133 are learned from, then one of 2, from the 200th on one of 3.
        Range [0, 0.5]; 0: nothing is left out. Raising it learns in less time, and from fewer examples near a
        condition's border. Of n of what is only roughly known, by approximations and regressions, or rests on such,
        one of ``n / 64`` is learned from, until it is one of 32, as long as intervals hold as often as they are to; but
        regressions learn from all. One random number decides for all that a step shows, so that most steps teach modes
        and clauses nothing.
    regression_columns
        Regressions on all that a target may depend on are made on at most so many columns, squares and products
        included. Default 320, range >= 0. A step costs as many products as the columns' square: some 0.1 ms.
    """

    clustering: ClusteringConfig = field(default_factory=ClusteringConfig)
    classification: ClassificationConfig = field(default_factory=ClassificationConfig)
    seed: int = 0
    geometry: Literal["arrays", "fcl"] = "arrays"
    abstain: bool = True
    cells_per_step: int = 250_000
    most_cells: int = 7_500_000
    saved_cells: int = 1_000_000_000
    frames: Literal["auto", "world"] = "auto"
    features: tuple[str, ...] = ()
    hypotheses: tuple[str, ...] = ()
    history: int = 200_000
    claim_error: float = 0.05
    claim_probability: float = 0.5
    claim_slips: float = 0.0075
    downsampling: float = 0.0075
    regression_columns: int = 320

    def __post_init__(self) -> None:
        plain(self)
        for name, kind in (("clustering", ClusteringConfig), ("classification", ClassificationConfig)):
            if not isinstance(getattr(self, name), kind):
                raise ConfigError(f"{name} must be a {kind.__name__}, got {getattr(self, name)!r}")
        one_of(self, geometry=("arrays", "fcl"), frames=("auto", "world"))
        at_least(self, 0, "seed", "saved_cells")
        at_least(self, 1, "cells_per_step", "most_cells")
        at_least(self, 100, "history")
        at_most(self, history=10**9)
        at_most(self, cells_per_step=10**15, most_cells=10**15, saved_cells=10**15)
        at_least(self, 0, "regression_columns")
        for name in ("claim_error", "claim_probability", "claim_slips"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} must lie in (0, 1], got {getattr(self, name)}")
        if not 0.0 <= self.downsampling <= 0.5:
            raise ConfigError(f"downsampling must lie in [0, 0.5], got {self.downsampling}")
        features: object = self.features
        if not isinstance(features, (tuple, list)) or not all(isinstance(entry, str) for entry in features):
            raise ConfigError(f"features must be a tuple of names, such as ('trig',), got {features!r}")
        named: object = self.hypotheses
        if not isinstance(named, (tuple, list)) or not all(isinstance(each, str) for each in named):
            raise ConfigError(f"hypotheses must be a tuple of registered names, got {named!r}")
        if len(set(named)) < len(named):
            raise ConfigError(f"hypotheses names a class twice: {named!r}; leave one out")

    @classmethod
    def of(cls, given: ModelConfig | Mapping[str, Any] | None) -> ModelConfig:
        """The parameters that are meant.

        Parameters
        ----------
        given
            A `ModelConfig`, a dict of those that differ from the default
            (``{"seed": 1, "clustering": {"draws": 500}}``), or ``None``: the default.

        Raises
        ------
        ConfigError
            Something else, unknown names, or values outside their range.
        """
        if given is None:
            return cls()
        if isinstance(given, ModelConfig):
            return given
        if not isinstance(given, Mapping):
            raise ConfigError(
                f"config={given!r}: expected a ModelConfig, or a dict of what differs from the default, such as "
                "{'features': ('trig',)}"
            )
        features, hypotheses = given.get("features", ()), given.get("hypotheses", ())
        try:
            parts = {
                "clustering": _part(ClusteringConfig, given.get("clustering", {})),
                "classification": _part(ClassificationConfig, given.get("classification", {})),
                "features": tuple(features) if isinstance(features, list) else features,
                "hypotheses": tuple(hypotheses) if isinstance(hypotheses, list) else hypotheses,
            }
            return cls(**{**given, **parts})
        except TypeError as error:
            raise ConfigError(f"config={dict(given)!r}: {error}; see relgym.config.ModelConfig") from None

    @property
    def classifying(self) -> ClassificationConfig:
        """`classification`, with no more examples of a mode than a short history has room for: a twentieth of it."""
        most = max(self.classification.exemplars_per_state, self.history // 20)
        return replace(self.classification, exemplars_alone=min(self.classification.exemplars_alone, most))

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return {name: value for name, value in asdict(self).items() if name != "hypotheses" or value}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> ModelConfig:
        """Read what `to_json` wrote; `ConfigError` for anything else."""
        return cls.of(data)


def _part(kind: type[Any], given: Any) -> Any:
    """One half of the parameters: a record as it is, or a dict of what differs from the default."""
    return given if isinstance(given, kind) else kind(**given)
