"""Parameters of the thesis' system, and every place where a rule here is not the printed one or the program's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from relgym.arguments import refusing_fields
from relgym.config.checks import at_least, one_of, plain
from relgym.errors import ConfigError

__all__ = ["DEVIATIONS", "Deviation", "ThesisSettings"]


@refusing_fields(ConfigError)
@dataclass(frozen=True, slots=True)
class ThesisSettings:
    """Free parameters of the thesis' system (`relgym.thesis.model.ThesisModel`).

    The defaults are those of chapter III. `original` has those of the program behind chapter IV, whose rules differ.

    Parameters
    ----------
    noise_variance
        σ², in squared units of the target.
    inlier_stds
        A point fits a line when it is at most so many σ away (§3.2.2: 2; the program: 3).
    min_examples
        T of §3.2.2.
    draws
        N of §3.2.2.
    sample
        Examples in a sample of RANSAC. The thesis doesn't say; the program's 6.
    unify_ratio
        R_unify of §3.2.5.
    em_iterations
        Most rounds of EM after one example.
    least_members
        A mode with fewer is deleted.
    constants
        Whether equal values are sought before RANSAC, as a mode ``y = c``.
    spread_samples
        Whether samples take two values of every column that varies, as far as they can.
    adaptive_draws
        Whether fewer samples than N are drawn once many inliers were seen (alarm rate 5 %).
    cross_check
        Whether a line is refused that needs more regressors when a third of its inliers is left out.
    refit_after_loss
        Whether a mode is fitted again when examples leave it.
    literal
        What ChooseLiteral maximises: ``"negatives"`` filtered out (Algorithm 2), or FOIL's ``"gain"``.
    max_literals
        Longest clause.
    max_variables
        Most new variables in a clause.
    grow_share
        Share of the examples that clauses are grown on; the others test them. 1: all do both.
    prune
        Whether literals are dropped that exclude nothing on the testing examples.
    max_false
        Largest share of false positives of a clause on the testing examples; one above it ends learning.
    tree_success
        Clauses and fall-throughs that are right in a smaller share of their examples get a decision tree (§3.4.4).
        Hand-tuned in the thesis, which doesn't print it: 72 of 196 wrong have a tree, 18 of 201 have none.
    tree_least
        Fewest examples of each class for a tree, among those that test it and those that it is grown on.
    tree_share
        Share of the examples that a tree is grown on; the others test it. 1: all do both.
    polarities
        Whether either mode of a pair may be the positive class (§3.4.5).
    context
        Whether clauses of mode classifiers speak of the target and what it touches (or else the nearest object) alone:
        ``"close"``; or of ``"all"`` objects, as in box pushing (Table 3.2).
    seed
        Of everything random.
    """

    noise_variance: float = 1e-15
    inlier_stds: float = 2.0
    min_examples: int = 40
    draws: int = 2000
    sample: int = 6
    unify_ratio: float = 0.9
    em_iterations: int = 50
    least_members: int = 1
    constants: bool = False
    spread_samples: bool = False
    adaptive_draws: bool = False
    cross_check: bool = False
    refit_after_loss: bool = False
    literal: Literal["negatives", "gain"] = "negatives"
    max_literals: int = 5
    max_variables: int = 2
    grow_share: float = 1.0
    prune: bool = False
    max_false: float = 1.0
    tree_success: float = 0.75
    tree_least: int = 2
    tree_share: float = 1.0
    polarities: bool = True
    context: Literal["close", "all"] = "close"
    seed: int = 0

    def __post_init__(self) -> None:
        plain(self)
        one_of(self, literal=("negatives", "gain"), context=("close", "all"))
        at_least(self, 1, "draws", "em_iterations", "least_members", "max_literals", "tree_least")
        at_least(self, 3, "sample", "min_examples")
        at_least(self, 0, "max_variables", "seed")
        for name in ("noise_variance", "inlier_stds"):
            if not 0.0 < getattr(self, name) < float("inf"):
                raise ConfigError(f"{name} must be a positive number, got {getattr(self, name)!r}")
        for name in ("unify_ratio", "grow_share", "max_false", "tree_success", "tree_share"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} must lie in (0, 1], got {getattr(self, name)!r}")

    @classmethod
    def thesis(cls, **changes: Any) -> ThesisSettings:
        """Chapter III as printed; `DEVIATIONS` lists what is not."""
        return replace(cls(), **changes)

    @classmethod
    def original(cls, **changes: Any) -> ThesisSettings:
        """The program behind chapter IV: its constants and its rules, those that make its errors included."""
        return replace(
            cls(
                inlier_stds=3.0,
                draws=1000,
                least_members=40,
                constants=True,
                spread_samples=True,
                adaptive_draws=True,
                cross_check=True,
                refit_after_loss=True,
                literal="gain",
                grow_share=0.75,
                prune=True,
                max_false=0.1,
                tree_least=30,
                tree_share=0.7,
            ),
            **changes,
        )


@dataclass(frozen=True, slots=True)
class Deviation:
    """A rule that isn't the printed one (or the program's).

    Attributes
    ----------
    preset
        ``"thesis"``, ``"original"`` or ``"both"``.
    section
        Where the printed rule stands.
    printed, here
        The two rules.
    reason
        Why.
    """

    preset: str
    section: str
    printed: str
    here: str
    reason: str


DEVIATIONS: Final = (
    Deviation(
        "thesis",
        "Algorithm 1, lines 7-8, 17",
        "S, the error of a fit with all regressors, scales Cp",
        "the given noise variance does, as in the program",
        "on exact data, and on samples with fewer rows than columns, S is 0 and Cp is 0/0",
    ),
    Deviation(
        "thesis",
        "Algorithm 1, line 5",
        "the remaining regressors are never fewer",
        "a chosen one leaves them",
        "the loop would choose the same regressor again",
    ),
    Deviation(
        "both",
        "§3.2.1",
        "functions w.x without a constant",
        "an intercept, found by centring",
        "every table of modes prints constants",
    ),
    Deviation(
        "both",
        "§3.2.2",
        "σ is a standard deviation, 1e-15",
        "the variance is 1e-15",
        "§4.6 sweeps variances; rounding of positions alone is 1e-15, so that no example would fit",
    ),
    Deviation(
        "both",
        "§3.2.2",
        "RANSAC whenever there is enough noise",
        "again when there is a twentieth part more noise",
        "it only saves time; the program waited for T - k more, if the best line had k inliers, and missed modes by it",
    ),
    Deviation(
        "both",
        "§3.2.2",
        "any line with T inliers",
        "columns that seldom change must take four values each, and together two more than there are weights on them",
        "six rows from two scenes fit exactly through whatever differs between the scenes, a size or a place",
    ),
    Deviation(
        "both",
        "§3.4.4",
        "a clause's tree tests the numbers of all objects that it binds",
        "the target's alone",
        "no clause of the thesis' tables has a tree; ours rarely",
    ),
    Deviation(
        "thesis",
        "§3.2.2",
        "the size of a sample is not printed",
        "6, as in the program",
        "a choice has to be made",
    ),
    Deviation(
        "thesis",
        "§3.2.5",
        "a unified function covers 90 % of the examples of both modes together",
        "90 % of those of each",
        "of 15,000 old and 41 new examples the old function alone covers 99.7 %: nothing new could stay",
    ),
    Deviation(
        "both",
        "§3.2.5",
        "whatever function covers two modes replaces them",
        "one that has fewer parameters than both together, and no more than the larger one",
        "-0.9 vy covers the examples of vy' = 0, where vy is 0: tables 4.2 and 4.9 could never hold both; and whatever "
        "differs between two scenes tells left from right in them. Late versions of the program did unite these; those "
        "of the experiments only united modes of one scene",
    ),
    Deviation(
        "both",
        "§3.2.5",
        "all examples of a mode count",
        "of a mode that has T examples of its own, those that no other mode explains",
        "where a ball flies straight down, both bounces off walls explain it: nine in ten examples of each (Table 4.9: "
        "388 of 437, 308 of 359), so that either one would do for both",
    ),
    Deviation(
        "both",
        "§3.2.5",
        "a new mode is unified with one existing mode",
        "and the unified one, which is new, with the next",
        "of three flights at three speeds any two would do for a function of whatever differs between two scenes; "
        "where a function is found for all, the others are to be discarded, too",
    ),
    Deviation(
        "both",
        "§3.2.5",
        "which objects of one type are lined up with which is not printed",
        "unification uses the target and objects that are alone of their type",
        "it is the program's rule",
    ),
    Deviation(
        "thesis",
        "§3.2.4",
        "modes without examples stay",
        "they are deleted",
        "nothing could ever choose them",
    ),
    Deviation(
        "thesis",
        "Algorithm 2, line 8",
        "literals are added until no negative is left",
        "or until none filters out a negative and keeps a positive, or five are there",
        "bouncing and sliding can look alike; the loop would not end",
    ),
    Deviation(
        "thesis",
        "Algorithm 2, line 5",
        "clauses are added until no positive is left",
        "or until one covers more negatives than positives",
        "it would describe the other mode",
    ),
    Deviation(
        "thesis",
        "Algorithm 2, line 9",
        "of literals that filter out equally many negatives any",
        "that which keeps most positives, then a positive one, then the first by name",
        "the printed clauses are those",
    ),
    Deviation(
        "thesis",
        "§3.4.3",
        "equal numbers of votes are not spoken of",
        "the younger mode wins, as in the program",
        "a choice has to be made",
    ),
    Deviation(
        "both",
        "§3.2.4",
        "a function is fitted again whenever its examples change",
        "a fit that explains fewer of them isn't taken",
        "forward-stepwise regression may miss the function that they lie on; the likelihood of EM would fall",
    ),
    Deviation(
        "original",
        "em.cpp",
        "errors within 0.1 % of one another are equal, and fewer weights decide",
        "the likelihood decides, as printed; of equal ones the oldest mode's",
        "the rule is younger than the experiments: Table 4.9 has 93 halts, while of 13,639 examples that slide some "
        "1,000 lie still and belong to vx' = vx; they would all be halts (§4.4.2: any of equals is taken)",
    ),
    Deviation(
        "thesis",
        "§3.2.4",
        "which of equally likely modes an example belongs to is not printed",
        "the oldest, and a united mode is as old as the older one of the two, as in the program",
        "where a ball falls straight down, flying and both bounces off walls are equally likely to double precision",
    ),
    Deviation(
        "original",
        "foil.cpp",
        "a literal mentions an object that is known already",
        "it may mention a new one alone, as ramp(B)",
        "tables 4.5 and 4.10 to 4.13 print such clauses",
    ),
    Deviation(
        "original",
        "em.cpp",
        "examples of a deleted mode are never learned from again",
        "they are noise again",
        "a slip that the thesis doesn't speak of",
    ),
    Deviation(
        "original",
        "em.cpp",
        "samples for unification mostly hold no new example",
        "half of each sample is new",
        "a slip: the code means to take from both sides",
    ),
    Deviation(
        "original",
        "linear.cpp",
        "the sweep operator on cross products",
        "orthogonalised columns",
        "half as many digits are lost; the same choices otherwise",
    ),
    Deviation(
        "original",
        "mode.cpp",
        "variables bound for one role stay bound for the next",
        "each role is looked for anew",
        "a slip; it matters in box pushing only",
    ),
    Deviation(
        "both",
        "§3.4",
        "every example is an example of its own",
        "examples with the same relations are counted together",
        "nothing differs but the time",
    ),
)
"""All places where a rule here is not the printed one (`thesis`) or the program's (`original`)."""
