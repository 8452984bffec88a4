"""Parameters of classification: when a mode holds, and which objects its roles are bound to (§3.4, §3.5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from relgym.arguments import refusing_fields
from relgym.config.checks import at_least, at_most, one_of, plain, unit
from relgym.config.constants import LEAST_EXEMPLARS
from relgym.errors import ConfigError

__all__ = ["ClassificationConfig"]


@refusing_fields(ConfigError)
@dataclass(frozen=True, slots=True)
class ClassificationConfig:
    """Parameters of mode and role classifiers: when a mode holds, and role binding (§3.4, §3.5).

    Parameters
    ----------
    context
        Which objects clauses of mode classifiers may mention. ``"approached"``: the target and what it approaches
        fastest (a contact fact). ``"touching"``: the target and all that touch it, or else the nearest one.
        ``"all"``: every object. ``"auto"`` (default): these are tried for every pair, the narrowest first, until a
        short definition makes no error; else the one with fewest errors is taken, of equals that of fewest bits, then
        the narrower context: of two causes that training can't tell apart, what decides a collision is the likelier.
    contact_facts
        Whether relations and features that the vocabulary marks as contact facts are offered (approach
        velocity, normal, slip). Default true; the thesis had none, hence its confusion of bouncing and
        leaving (§4.8).
    max_literals
        Longest clause, in literals. Default 5 (as the original), range 1 to 64. Raising it admits finer
        distinctions at a cost that grows linearly.
    max_clauses
        Most clauses of one definition. Default 8, range 1 to 256.
    max_new_variables
        Most existential variables of one clause. Default 2, range 0 to 4. Cost grows with objects to this
        power.
    beam
        Clauses grown at the same time. Default 4, range 1 to 256; 1 is the greedy search of Algorithm 2. Raising
        it finds conjunctions whose first literal gains nothing alone, at proportional cost.
    clause_tree_threshold
        A clause whose false-positive rate exceeds this gets a decision tree (§3.4.4). Default 0.01, range [0,
        1] (thesis-like: 0.05). Raising it gives fewer trees, that overfit less and separate less.
    fall_through_tree_threshold
        The same for the false-negative rate of the whole disjunction. Default 0.02, range [0, 1]
        (thesis-like: 0.2).
    tree_min_leaf
        Fewest examples on either side of a split. Default 3, range 1 to a million (the original: no split of
        3 or fewer).
    tree_max_depth
        Deepest tree, in splits. Default 6, range 1 to 64.
    exemplars_per_state
        Examples kept per mode and relational state, those that contradicted a classifier first. Default 10,
        range 1 to 10,000,000. Raising it makes early thresholds sharper and costs time and memory in proportion; on the
        ball data 6, 12 and 30 end equally well, because contradictions stay.
    exemplars_alone
        The same where objects have no bodies, and so there is but one relational state; at most a twentieth of the
        history (`ModelConfig.history`), which they are part of. Default 3000, range 1 to 10,000,000. Few examples
        of a mode leave thresholds blunt there, and where rare events can't be predicted they seem to be, in corners of
        which no other example is left: of 43 touches of a LunarLander's leg that were predicted among 300, 38 were
        none.
    noise_per_state
        The same for noise, whose examples may still become a rare mode. Default 200, range 1 to
        10,000,000.
    max_exemplars
        Examples kept in all. Default 6000, range 100 to 10,000,000.
    exemplar_memory
        Memory that they may take, for each target, in MB. Relations are told of all pairs of bodies, so an example of
        40 bodies takes 21 kB and one of 200 takes 0.5 MB. Default 128, which is 6000 examples of 40 bodies, as many
        as large scenes are taken apart into; range 1 to 1,000,000. At least 100 examples are kept whatever they take.
    relearn_growth
        An imperfect or mended pair is learned anew when its rarer mode's examples have grown by this factor.
        Default 1.5, range > 1. Raising it saves time and lets definitions age.
    """

    context: Literal["auto", "approached", "touching", "all"] = "auto"
    contact_facts: bool = True
    max_literals: int = 5
    max_clauses: int = 8
    max_new_variables: int = 2
    beam: int = 4
    clause_tree_threshold: float = 0.01
    fall_through_tree_threshold: float = 0.02
    tree_min_leaf: int = 3
    tree_max_depth: int = 6
    exemplars_per_state: int = 10
    exemplars_alone: int = 3000
    noise_per_state: int = 200
    max_exemplars: int = 6000
    exemplar_memory: int = 128
    relearn_growth: float = 1.5

    def __post_init__(self) -> None:
        plain(self)
        one_of(self, context=("auto", "approached", "touching", "all"))
        at_least(self, 1, "max_literals", "max_clauses", "beam", "tree_min_leaf", "tree_max_depth")
        at_least(self, 1, "exemplars_per_state", "exemplars_alone", "noise_per_state")
        at_least(self, 0, "max_new_variables")
        at_least(self, LEAST_EXEMPLARS, "max_exemplars")
        at_least(self, 1, "exemplar_memory")
        # Searches may take long, but not for ever.
        at_most(self, max_literals=64, max_clauses=256, max_new_variables=4, beam=256, tree_max_depth=64)
        at_most(
            self, **dict.fromkeys(("exemplars_per_state", "exemplars_alone", "noise_per_state"), 10_000_000)
        )
        at_most(self, max_exemplars=10_000_000, exemplar_memory=1_000_000, tree_min_leaf=1_000_000)
        unit(self, "clause_tree_threshold", "fall_through_tree_threshold")
        if not self.relearn_growth > 1:
            raise ConfigError(f"relearn_growth must be greater than 1, got {self.relearn_growth}")
