"""Agents that train in what they have learned, whatever trains them: a model beside the agent, and dreams.

Public names are those of `relgym.wrappers.sb3`, which joins them to Stable-Baselines3; nothing here knows it.

- `TransitionRecorder`, innermost, writes real steps down as scenes; a `Lens` reads the wrappers outside it and shows
  a dream's scenes as the agent would see them. Wrappers that remember (a reset of their own) are refused, and so are
  decisions that last longer than dreamed ones: dreams and the world would get into one another.
- A `ModelTrainer` lets the model predict each real step, measures its error (`ModelAcceptance`), and lets it learn in
  shuffled order. Beside a model that was accepted and then rejected, a replacement learns the same steps from
  nothing; whichever is accepted first is used. The rejection is all the evidence of change there is; if it is
  mistaken, only the replacement's computing time is lost.
- A `SceneStock` keeps real scenes; `SceneStock.starts` draws what dreams begin in, for `Dyna` and `DreamVecEnv`
  alike, and varies it as far as `DynaConfig` says (`permute`, `resample`, `perturb_velocity`).
- `Imagination` follows the policy through many dreams at once; a `RewardModel` gives rewards and ends: the env's own
  `Task`, or a `LearnedRewardModel`, which learns the reward given whether the step ends the episode, and knows a
  verdict only where its modes of both were right of one and the same real step, among the latest ones and a reservoir
  of those before.
- `Dyna` (off-policy) mixes imagined transitions into batches while the model is accepted, and makes catch-up updates
  when it is first accepted and when a learned reward model has learned another reward or end (`DynaConfig.catch_up`,
  `LearnedRewardModel.verdicts`); while the model is rejected, training is Stable-Baselines3's own, to the last bit.
  What it changes in the algorithm (gradient steps, the mix) it changes only while it trains: whatever is saved is the
  agent's own. `DreamVecEnv` and `DreamCheckup` (on-policy) train inside the dream.
- A `LearnedRewardModel` has the methods of an env's `Task` (`relgym.envs.tasks.RewardFunctions`):
  ``LearnedModelEnv(..., task=dyna.trainer.reward_model)`` dreams of what the agent has found out. Where it doesn't
  know, the dream is cut off. It is kept in a file of its own (`save`, `load`): a model's, with what the reward model
  remembers beside it.
"""
