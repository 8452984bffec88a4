"""How right a program's predictions were: calibration, written down as a table that kernels and exported Python read.

`relgym.model.predicting.calibration` knows the cells that predictions fell into; of each of them, and of every set of
experts that may have a value there, the table says who speaks, how probably that is right, and whether it is claimed.
"""

from __future__ import annotations

from dataclasses import replace

from relgym.model.parts import Parts
from relgym.model.predicting.calibration import GUESS, OWN, REGRESSION
from relgym.model.predicting.prediction import OUTCOMES, Outcome
from relgym.model.target.property_model import PropertyModel
from relgym.program import records as ir
from relgym.scene.objects import SceneLayout

__all__ = ["trusting"]

KINDS = OUTCOMES.index(Outcome.UNSURE)
"""Outcomes before what is known of them is asked: all but `Outcome.UNSURE`."""


def trusting(parts: Parts, layout: SceneLayout, program: ir.Program) -> ir.Program:
    """A program that knows how right its predictions were; the same one where nobody ever looked back.

    Raises
    ------
    BeyondError
        Laws of `ModelConfig.hypotheses` may give values.

    Notes
    -----
    Cost: some 10 µs for each cell of each target.
    """
    beliefs: dict[tuple[str, str], tuple[ir.Belief, ...]] = {}
    answers = []
    keys = {(layout.types[layout.index(a.object)].name, a.property): a.key for a in program.answers}
    for a in program.answers:
        index = layout.index(a.object)
        model = parts.property_model(layout.types[index].name, a.property)
        if not model.calibration.trials:
            answers.append(a)
            continue
        if model.candidates:
            raise ir.BeyondError("laws of hypothesis classes that were added")
        guessed = a.guess is not None or a.beyond is not None
        having = ((OWN, True), (GUESS, guessed), (REGRESSION, a.regression is not None))
        able = sum(1 << expert for expert, has in having if has)
        key = layout.types[index].name, a.property
        if key not in beliefs:
            beliefs[key] = tuple(_beliefs(model, able))
        distant = model.tells_how_far and a.regression is not None
        relied_on = parts.relied_on(model)
        rests = tuple(number for pair, number in keys.items() if pair in relied_on and number in a.needs)
        answers.append(replace(a, trust=ir.Trust(beliefs[key], a.component >= 0, distant, rests)))
    return replace(program, answers=tuple(answers))


def _beliefs(model: PropertyModel, able: int) -> list[ir.Belief]:
    """What is made of all kinds of predictions, whoever of those who may have a value has one."""
    some = [bits for bits in range(able + 1) if bits & ~able == 0]
    return [
        ir.Belief(*key, bits, told.speaker, told.probability, told.interval, claimed, told.spread)
        for key, bits, told, claimed in model.record.table(KINDS, some, distant=model.tells_how_far)
    ]
