"""What relgym is compared with: today's alternatives, all behind one interface (`relgym.baselines.base`).

They see a scene as a row of numbers, in two ways: the thesis' features (all properties of all objects, centred on the
target or not) and the contact features that relgym's own clauses see. A comparison is between learners that were
shown the same; every cell lost is listed with the true mode that most of the error is of, and whether that was
learned. Each has the same number of settings to choose from, on tuning seeds (``relgym reproduce tuning``). A
baseline is a name, settings and a recipe (`recipes.py`), the same for regressors and classifiers.
"""
