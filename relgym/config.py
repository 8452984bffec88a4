"""All free parameters of relgym, as frozen dataclasses.

Every field says what it means, its symbol and section in the thesis where it has one, its default and range,
and what raising it does. Nothing here imports the rest of the package.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from relgym.errors import ConfigError

__all__ = ["ClassificationConfig", "ClusteringConfig", "ModelConfig"]


@dataclass(frozen=True, slots=True)
class ClassificationConfig:
    """Preconditions: when does a mode hold, and which object plays which role (§3.4, §3.5).

    Parameters
    ----------
    votes
        How binary classifiers are combined (§3.4.3). ``"hard"``: one vote each, as in the thesis. ``"soft"``
        (default): log-probabilities of the clause that fired, so that one unsure pair decides nothing.
    runoff
        Whether the mode with fewest votes drops out and the others' votes are counted again, until one is left.
        Default true: a pair says nothing sensible of examples of a third mode. False: the most votes win, as in
        the thesis.
    context
        Which objects clauses of mode classifiers speak of. ``"approached"``: the target and what it approaches
        fastest (a contact fact). ``"touching"``: the target and all that touch it, or else the nearest one.
        ``"all"``: every object. ``"auto"`` (default): these are tried for every pair, the narrowest first, until a
        short definition makes no error; else the one with fewest errors is taken, of equals that of fewest bits, then
        the narrower context: of two causes that training can't tell apart, what decides a collision is the likelier.
    contact_facts
        Whether relations and features that the vocabulary marks as contact facts are offered (approach
        velocity, normal, slip). Default true; the thesis had none, hence its confusion of bouncing and
        leaving (§4.8).
    numeric_literals
        Whether clauses may hold numeric thresholds. Default true; the thesis kept numbers to trees (§3.4.4).
    mode_function_features
        Whether the two modes' predictions and their difference are offered as numbers. Default true.
        Boundaries of friction and halting become one threshold.
    ambiguous
        What to do with an example that several modes explain. ``"drop"`` (default): it teaches nothing to a
        pair of them. Against all others it speaks for the mode it was assigned to, the simplest; or for another
        one of them, if only that one was seen beyond doubt in the same relations
        (`relgym.classification.owners`). ``"keep"``: it counts for the mode it was assigned to, as in the thesis.
    both_polarities
        Whether either mode of a pair may be the positive class (§3.4.5). Default true.
    literal_choice
        What ChooseLiteral maximises (Algorithm 2): ``"gain"`` (default): FOIL's information gain, as in the
        original system; ``"negatives"``: the negatives filtered out, as printed.
    max_literals
        Longest clause, in literals. Default 5 (as the original), range >= 1. Raising it admits finer
        distinctions at a cost that grows linearly.
    max_clauses
        Most clauses of one definition. Default 8, range >= 1.
    max_new_variables
        Most existential variables of one clause. Default 2, range >= 0. Cost grows with objects to this
        power.
    beam
        Clauses grown at the same time. Default 4, range >= 1; 1 is the greedy search of Algorithm 2. Raising
        it finds conjunctions whose first literal gains nothing alone, at proportional cost.
    mdl
        Whether a clause must pay for its bits in exceptions explained. Default true.
    min_precision
        Least share of positives among the examples that a clause covers, weighted. Default 0.5, range
        [0.5, 1] (the original: 0.9 on a held-out quarter). Raising it leaves more to the tree of the
        fall-through.
    clause_tree_threshold
        A clause whose false-positive rate exceeds this gets a decision tree (§3.4.4). Default 0.01, range [0,
        1] (thesis-like: 0.05). Raising it gives fewer trees, that overfit less and separate less.
    fall_through_tree_threshold
        The same for the false-negative rate of the whole disjunction. Default 0.02, range [0, 1]
        (thesis-like: 0.2).
    tree_errors
        Of what the two rates above are shares. ``"class"`` (default): of the examples decided at that stage or of
        the class that suffers, whichever share is larger, so that a rare mode's errors count. ``"stage"``: of the
        examples decided there, as in the original; 99 bounces taken for slides among 5,223 call for no tree then.
    tree_min_leaf
        Fewest examples on either side of a split. Default 3, range >= 1 (the original: no split of 3 or
        fewer).
    tree_max_depth
        Deepest tree, in splits. Default 6, range >= 1.
    class_balance
        Exponent in [0, 1] by which classes are balanced: each is weighted by (its share) ** -class_balance.
        Default 0: description length counts a rare class' examples dearly already; 1 gives both classes equal
        say, which makes frequent modes suffer where the data are noisy.
    exemplars_per_state
        Examples kept per mode and relational state, those that contradicted a classifier first. Default 10,
        range >= 1. Raising it makes early thresholds sharper and costs time and memory in proportion; on the
        ball data 6, 12 and 30 end equally well, because contradictions stay.
    exemplars_alone
        The same where objects have no bodies, and so there is but one relational state; at most a twentieth of the
        history (`ModelConfig.history`), which they are part of. Default 300, range >= 1. Few examples of a mode leave
        thresholds blunt there.
    noise_per_state
        The same for noise, whose examples may still become a rare mode. Default 200, range >= 1.
    max_exemplars
        Examples kept in all. Default 6000, range >= 100.
    repair
        Whether a contradicted definition is first mended (a threshold moved, a clause dropped or added) and
        only learned anew where that isn't enough (§5.1). Default true.
    relearn_growth
        An imperfect or mended pair is learned anew when its rarer mode's examples have grown by this factor.
        Default 1.5, range > 1. Raising it saves time and lets definitions age.
    """

    votes: Literal["soft", "hard"] = "soft"
    runoff: bool = True
    context: Literal["auto", "approached", "touching", "all"] = "auto"
    contact_facts: bool = True
    numeric_literals: bool = True
    mode_function_features: bool = True
    ambiguous: Literal["drop", "keep"] = "drop"
    both_polarities: bool = True
    literal_choice: Literal["gain", "negatives"] = "gain"
    max_literals: int = 5
    max_clauses: int = 8
    max_new_variables: int = 2
    beam: int = 4
    mdl: bool = True
    min_precision: float = 0.5
    clause_tree_threshold: float = 0.01
    fall_through_tree_threshold: float = 0.02
    tree_errors: Literal["class", "stage"] = "class"
    tree_min_leaf: int = 3
    tree_max_depth: int = 6
    class_balance: float = 0.0
    exemplars_per_state: int = 10
    exemplars_alone: int = 300
    noise_per_state: int = 200
    max_exemplars: int = 6000
    repair: bool = True
    relearn_growth: float = 1.5

    def __post_init__(self) -> None:
        _one_of(self, votes=("soft", "hard"), context=("auto", "approached", "touching", "all"))
        _one_of(self, ambiguous=("drop", "keep"), literal_choice=("gain", "negatives"))
        _one_of(self, tree_errors=("class", "stage"))
        _at_least(self, 1, "max_literals", "max_clauses", "beam", "tree_min_leaf", "tree_max_depth")
        _at_least(self, 1, "exemplars_per_state", "exemplars_alone", "noise_per_state")
        _at_least(self, 0, "max_new_variables")
        _at_least(self, 100, "max_exemplars")
        _unit(self, "min_precision", "clause_tree_threshold", "fall_through_tree_threshold", "class_balance")
        _at_least(self, 0.5, "min_precision")
        if not self.relearn_growth > 1:
            raise ConfigError(f"relearn_growth must be greater than 1, got {self.relearn_growth}")

    @classmethod
    def thesis(cls, **changes: Any) -> ClassificationConfig:
        """§3.4 as published: hard votes, only relations, greedy search, few trees, arbitrary labels.

        Mended where it can't work as printed: the inner loop of Algorithm 2 stops at a clause that describes
        more than it explains and never gives up all positives; a rejected clause doesn't end learning; errors
        are counted on all examples.
        """
        return replace(_THESIS, **changes)

    @classmethod
    def original(cls, **changes: Any) -> ClassificationConfig:
        """The constants of the thesis' own system: FOIL gain, 90 % precision, trees where 25 % of a stage are wrong."""
        trees: dict[str, Any] = {"clause_tree_threshold": 0.25, "fall_through_tree_threshold": 0.25}
        trees["tree_errors"] = "stage"
        return replace(_THESIS, literal_choice="gain", mdl=False, min_precision=0.9, **(trees | changes))


@dataclass(frozen=True, slots=True)
class ClusteringConfig:
    """Modes: discovery, assignment and unification (§3.2).

    Parameters
    ----------
    noise_std
        σ of §3.2.2, the standard deviation of the noise on a target, in its units. ``"auto"`` (default)
        estimates it per target from the data and their precision; a positive number overrides the estimate.
        Too large folds behaviours into one mode, too small learns none (§4.6).
    inlier_stds
        An example fits a function when its residual is at most this many σ. Default 4 (thesis 2, original 3).
        Raising it admits more of a noisy mode's tail.
    tail_stds
        Noise within this many σ of a known mode never seeds another. Default 6: an estimated σ may be a third too
        small. Raising it prevents duplicates of a noisy frequent mode and hides behaviours that differ by less.
    min_examples
        T of §3.2.2, examples needed to found a mode; it is deleted below half of them. ``"auto"`` (default):
        10 where data are exact, because each further example then verifies the function to many digits, up to
        40 (the thesis' value) the noisier they are. Raising it learns later and fewer modes.
    draws
        N of §3.2.2, samples drawn per search. Default 1536 (thesis 2000). Raising it finds rarer modes
        sooner.
    max_terms
        Largest number of weights in a mode. Default 8.
    own_only
        Whether only the target's own properties (and bodiless objects') may enter. Default false.
    unify_ratio
        R_unify of §3.2.5: share of the examples of *each* side that a unified function must explain. Default 0.9, as
        in the thesis: a side may owe a few of its examples to coincidence. Raising it leaves more modes apart.
    support
        Number of examples that must back each weight: what fewer than this many leverage points alone
        determine isn't learned. Default 3.
    refit_growth
        A mode is refitted when its examples have grown by this factor. Default 2.
    approximate
        Whether, where no exact law explains most examples, the best sparse function is taken that leaves at most a
        tenth of the change, with its residuals as noise. Default true; the thesis had no such thing.
    stickiness
        Whether, of the modes that explain an example equally well, those with fewest parameters win
        ("simple", default) or, as in the original program, whichever is nearest ("nearest").
    review
        Whether, where noise is so large that modes explain each other's examples by chance (an example verifies a
        function by 12 bits at most), all are assigned anew as they become more, by their errors and by what each mode
        has in their relational state; and modes are sought among those that are explained badly
        (`relgym.clustering.suspects`). Default true; the thesis knew noise as what no mode explains. Needs more than
        one relational state, so bodies: without them it does nothing.
    """

    noise_std: float | Literal["auto"] = "auto"
    inlier_stds: float = 4.0
    tail_stds: float = 6.0
    min_examples: int | Literal["auto"] = "auto"
    draws: int = 1536
    max_terms: int = 8
    own_only: bool = False
    unify_ratio: float = 0.9
    support: int = 3
    refit_growth: float = 2.0
    approximate: bool = True
    stickiness: Literal["simple", "nearest"] = "simple"
    review: bool = True

    def __post_init__(self) -> None:
        _one_of(self, stickiness=("simple", "nearest"))
        _at_least(self, 1, "draws", "support")
        _at_least(self, 0, "max_terms")
        noise: object = self.noise_std
        least: object = self.min_examples
        if noise != "auto" and not (isinstance(noise, int | float) and noise > 0):
            raise ConfigError(f"noise_std must be 'auto' or a positive float, got {self.noise_std!r}")
        if least != "auto" and not (isinstance(least, int) and least >= 4):
            raise ConfigError(f"min_examples must be 'auto' or an int >= 4, got {self.min_examples!r}")
        if not 0.5 <= self.unify_ratio <= 1.0:
            raise ConfigError(f"unify_ratio must lie in [0.5, 1], got {self.unify_ratio}")
        if not self.refit_growth > 1.0:
            raise ConfigError(f"refit_growth must be greater than 1, got {self.refit_growth}")


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
        instead of being predicted. Default true; false: the votes decide there as everywhere.
    work_per_step
        Budget for re-learning classifiers after one transition, in deterministic units (tuples times candidate
        literals examined). Default 400,000, some 20 ms; a search once begun is finished, whatever it costs.
        Raising it makes rules fresher and single steps slower.
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
    history
        Examples kept per object type; memory stays flat beyond. Default 200,000, range >= 100. Of more, a uniform
        choice stays, and everything rare: small modes, recent noise, and what classifiers remember. Raising it costs
        memory (some 100 bytes an example and upwards), lowering it makes late discoveries rest on fewer examples.
    """

    clustering: ClusteringConfig = field(default_factory=ClusteringConfig)
    classification: ClassificationConfig = field(default_factory=ClassificationConfig)
    seed: int = 0
    geometry: Literal["arrays", "fcl"] = "arrays"
    abstain: bool = True
    work_per_step: int = 400_000
    frames: Literal["auto", "world"] = "auto"
    features: tuple[str, ...] = ()
    history: int = 200_000

    def __post_init__(self) -> None:
        _one_of(self, geometry=("arrays", "fcl"), frames=("auto", "world"))
        _at_least(self, 0, "seed", "work_per_step")
        _at_least(self, 100, "history")
        features: object = self.features
        if not isinstance(features, (tuple, list)) or not all(isinstance(entry, str) for entry in features):
            raise ConfigError(f"features must be a tuple of names, such as ('trig',), got {features!r}")

    @property
    def classifying(self) -> ClassificationConfig:
        """`classification`, with no more examples of a mode than a short history has room for: a twentieth of it."""
        most = max(self.classification.exemplars_per_state, self.history // 20)
        return replace(self.classification, exemplars_alone=min(self.classification.exemplars_alone, most))

    @classmethod
    def thesis(cls, **changes: Any) -> ModelConfig:
        """Chapter III as published: T=40, N=2000, 2σ, R_unify=0.9, hard votes, no contact facts; always an answer.

        Mends, each because the text doesn't work as printed: the noise variance in Mallows's Cp is the given one, not
        the full model's (0/0 on exact data); a chosen regressor leaves the candidates; a removed mode's examples
        return to the noise; FOIL stops at clauses that describe more than they explain, and a rejected clause doesn't
        end learning; errors are counted on all examples; residuals within the noise are ties, won by the simpler mode;
        roles are assigned jointly.

        Differences that serve bounded memory and time: FOIL sees at most `exemplars_per_state` examples of a mode in a
        relational state, weighted; σ is estimated unless it is given.
        """
        clustering = ClusteringConfig(
            min_examples=40, draws=2000, inlier_stds=2.0, unify_ratio=0.9, approximate=False, review=False
        )
        return cls._world(clustering, ClassificationConfig.thesis(), **changes)

    @classmethod
    def original(cls, **changes: Any) -> ModelConfig:
        """The constants of the thesis' own program: 3σ with σ² = 1e-15, N=1000, T=40, FOIL gain, trees above 25 %.

        Not copied are its defects: errors of clauses counted on a quarter of the negatives only, examples of deleted
        modes lost, unification samples that hold no new example, variables leaking between roles. Nor is its test of
        decision trees on held-out examples, which kept trees from modes of fewer than 60: here they pay in description
        length. Ties of votes go to the mode with more examples, not to the younger one.
        """
        clustering = ClusteringConfig(
            noise_std=3.1622776601683795e-08,
            min_examples=40,
            draws=1000,
            inlier_stds=3.0,
            unify_ratio=0.9,
            approximate=False,
            stickiness="nearest",
            review=False,
        )
        return cls._world(clustering, ClassificationConfig.original(), **changes)

    @classmethod
    def _world(
        cls, clustering: ClusteringConfig, classification: ClassificationConfig, **changes: Any
    ) -> ModelConfig:
        """A preset of the thesis' learner, which knows the world's axes only, and always answers."""
        return replace(cls(clustering, classification, abstain=False, frames="world"), **changes)

    def to_json(self) -> dict[str, Any]:
        """Plain data that `from_json` reads back."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> ModelConfig:
        """Read what `to_json` wrote."""
        return cls(
            **{
                **data,
                "clustering": ClusteringConfig(**data["clustering"]),
                "classification": ClassificationConfig(**data["classification"]),
                "features": tuple(data.get("features", ())),
            }
        )


def _one_of(config: object, **allowed: tuple[str, ...]) -> None:
    for name, values in allowed.items():
        if getattr(config, name) not in values:
            raise ConfigError(f"{name} must be one of {values}, got {getattr(config, name)!r}")


def _at_least(config: object, low: float, *names: str) -> None:
    for name in names:
        if not getattr(config, name) >= low:
            raise ConfigError(f"{name} must be at least {low}, got {getattr(config, name)!r}")


def _unit(config: object, *names: str) -> None:
    for name in names:
        if not 0 <= getattr(config, name) <= 1:
            raise ConfigError(f"{name} must lie in [0, 1], got {getattr(config, name)!r}")


_THESIS = ClassificationConfig(
    votes="hard",
    runoff=False,
    context="touching",
    contact_facts=False,
    numeric_literals=False,
    mode_function_features=False,
    ambiguous="keep",
    literal_choice="negatives",
    beam=1,
    clause_tree_threshold=0.05,
    fall_through_tree_threshold=0.2,
    repair=False,
)
