"""A learned model as an env, one dream or thousands: setting, step, rewards, ends, and what is shown of them.

`LearnedModelEnv` is one dream, `LearnedModelVectorEnv` (the id's `vector_entry_point`) are thousands with the same
objects, stepped by arrays; for equal scenes and actions they agree to the last bit. They share

- the *setting*: model, spaces, first scenes. These come from the model's file, or from a real env or a scene whose
  types the model knows: numbers and names of objects may be others than in training. Models that were learned through
  a view show what the view's env shows, and have no schema where that had none, so that whatever goes round the env
  goes round the dream. What a space's dtype can't hold has left the space. Views of numbers show many scenes at once;
  others may (`View`), or do so one by one;
- the *reward functions*: reward and termination are given functions, or those of an env's `task`, or the model's own
  predictions of the bodiless object `task`, whose properties are 0 before each step; settled at each reset, since a
  live model learns;
- the *ends*: a prediction that no mode makes, that leads the runner-up by less than `min_margin`, or that leaves the
  observation space is not followed; ``info["cause"]`` names the cause, ``info["reason"]`` says it in a sentence.

`DreamStep` is the step as a pure function of state vectors. `wrappers.sb3.VectorAsVecEnv` makes a Stable-Baselines3
`VecEnv` of any Gymnasium vector env. All three autoreset modes exist; dreams are live or of a snapshot.
"""
