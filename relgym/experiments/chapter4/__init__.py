"""Chapter IV of the thesis as jobs: one per table and figure, each beside the numbers printed there.

- A *job* (`chapter4/catalogue.py`) names the tasks that it rests on and renders their results. `Protocol` says how
  many batches, test examples and checkpoints: the thesis' own, or `--fast`.
- A *task* (`jobs/task.py`) is a function by name and plain arguments, seeds among them. Its key is a digest of both
  and of the code behind the function: every module of relgym that it imports, step by step, without comments and
  docstrings, and without what a task says it runs nothing of (`jobs/code.py`: `LEARNER`). Drawing code is not behind
  what was measured, so a figure can change without a new measurement.
- The *store* keeps one file per key, checksummed and written atomically. A run computes what is missing; a kill costs
  the tasks that were running. Several jobs share tasks: tables 4.2 to 4.8 rest on the same trainings.
- Errors are pooled as histograms over twenty bins a decade, so that quantiles over 50 batches need no list of all.
- *The thesis' system* (`relgym.thesis`) is a learner of its own, not a setting of relgym's: each file says which
  algorithm or section it is, `settings.DEVIATIONS` where it differs from the text or the program, and why. It learns
  experiment 1 in some seconds, because examples with the same relations are counted together.
- *Scenes* of chapter IV have the thesis' frequencies (`relgym.experiments.scenes`): what is known of them, and what
  is fitted on seeds of their own.
- *Roll-outs* (`chapter4/rolled.py`) are corrected by hand as the thesis' were, and counted as they are, too.
- *Claims* (`chapter4/claims.py`): the thesis' sentences with numbers, how ours are measured, and bands, which are
  ours.
- *Staleness*: sections state a digest of the code behind them. A page may be older than the code if it says so at its
  top; ``python -m relgym.experiments.chapter4.staleness PAGE --mark`` writes that.
- *Ablations* are named configurations of the thesis' program, each with one cause of its errors taken away, always
  tested on all 24,000 examples. In a tenth of them a ball rests or doesn't, and rates differ threefold.
- joblib runs the tasks: processes here, or a cluster that is already there (``--backend dask|ray --address ...``),
  with one thread of linear algebra each; the numbers are the same everywhere.
"""
