# %% [markdown]
# # A bouncing ball and its laws
#
# A ball flies through a room, hits walls, floor, box and ramp, and rolls. We watch it for 4,000 steps, read
# what was learned, and let the model imagine episodes that it has never seen.

# %%
import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

from relgym.wrappers import ModelLearner

world = {"elasticity": 0.9, "friction": 0.2}
env = gym.make("relgym/BallBoxRamp-v0", incline=30, **world, render_mode="rgb_array")
observation, _ = env.reset(seed=1)
plt.figure(figsize=(6, 3.75))
plt.imshow(env.render())
_ = plt.axis("off")
# %% [markdown]
# An observation is a dictionary from object name to its properties: position, rotation, extents and, of a
# ball, its velocity, which is its last displacement. Nothing says which of the numbers matter, or that there
# is such a thing as gravity.

# %%
for name, values in observation.items():
    print(f"{name:10}", *(f"{value:6.2f}" for value in values))

# %% [markdown]
# ## Learn
#
# `ModelLearner` goes round the env and leaves all that it returns as it is. At every step it predicts first
# and learns afterwards, so each error is counted on a transition that the model hadn't seen. `info["relgym"]`
# is the report of one step.

# %%
learner = ModelLearner(env)
learner.reset(seed=0)
wrong = []
for _ in range(4_000):
    *_, terminated, truncated, info = learner.step(0)
    wrong.append(bool(info["relgym"].wrong))
    if terminated or truncated:
        learner.reset()

plt.figure(figsize=(7, 2.5))
plt.plot(np.cumsum(wrong))
plt.xlabel("steps")
plt.ylabel("wrong or abstained, in all")
plt.title("Each prediction was made before its outcome was known")
print(f"{sum(wrong)} of 4,000 steps; {sum(wrong[2_000:])} of the last 2,000")

# %% [markdown]
# ## Read
#
# What was learned is text. In free flight the velocity loses 0.00098 a step. At a contact, along its normal,
# the ball bounces with 0.9 of the velocity that it came with, or keeps what it would have had; across it,
# friction takes 0.2 of the normal impulse, and at most all there is. These are the constants with which the
# env was made, and nobody told them to the learner.

# %%
model = learner.model
print(model.describe())

# %% [markdown]
# ## Imagine
#
# `rollout` feeds the model its own predictions. Here are twenty fresh episodes of 200 steps, real and
# imagined; the model sees the first scene of each, and nothing after that.

# %%
real = gym.make("relgym/BallBoxRamp-v0", incline=30, **world).unwrapped
episodes = []
for seed in range(1_000, 1_020):
    place = ("above-left", "between", "above-right", "leftmost")[seed % 4]
    real.reset(seed=seed, options={"ball": place})
    first, scenes = real.scene, []
    for _ in range(200):
        real.step(0)
        scenes.append(real.scene)
    dreamt = [step.scene for step in model.rollout(first, 200)]
    seen, imagined = ([(s["ball"]["px"], s["ball"]["py"]) for s in track] for track in (scenes, dreamt))
    episodes.append((first, seen, imagined))

apart = [np.abs(np.subtract(seen, thought)).max() for _, seen, thought in episodes]
print(f"{len(apart)} episodes: real and imagined balls are never more than {max(apart):.1e} apart")

# %%
fig, axes = plt.subplots(1, 3, figsize=(9, 1.9))
for ax, (first, seen, imagined) in zip(axes, episodes, strict=False):
    for name, colour in (("box", "steelblue"), ("ramp", "seagreen"), ("floor", "0.8")):
        x, y, w, h = (first[name][prop] for prop in ("px", "py", "sx", "sy"))
        corners = [(x - w / 2, y - h / 2), (x + w / 2, y - h / 2), (x - w / 2, y + h / 2)]
        if name != "ramp":
            corners.insert(2, (x + w / 2, y + h / 2))
        ax.fill(*np.transpose(corners), color=colour, alpha=0.5)
    ax.plot(*np.transpose(seen), color="0.6", linewidth=5, label="real")
    ax.plot(*np.transpose(imagined), color="tab:orange", linewidth=1.5, label="imagined")
    ax.plot(*seen[0], "o", color="black", markersize=6)
    ax.set_aspect("equal", "datalim")
    ax.axis("off")
_ = axes[0].legend(loc="upper left", fontsize=8)

# %% [markdown]
# ## Another room
#
# Laws that are stated in the frame of the contact know nothing of a particular slope. The same model, in
# rooms whose ramp is twice as steep, with two ramps instead of one:

# %%
steep = gym.make("relgym/BallBoxRamp-v0", incline=60, **world, objects=("ramp", "ramp"))
tested, off = 0, 0.0
for seed in range(5):
    steep.reset(seed=seed)
    for _ in range(200):
        predicted = model.predict_one(steep.unwrapped.scene).scene
        steep.step(0)
        came = steep.unwrapped.scene
        off = max(off, *(abs(predicted["ball"][p] - came["ball"][p]) for p in ("vx", "vy")))
        tested += 1
print(f"{tested} steps, off by at most {off:.1e}")

# %% [markdown]
# ## Where to go on
#
# [Read a model](../guides/reading-a-model.html) explains such texts line by line, and shows the modes of the
# thesis beside these laws. [The next tutorial](classic-control.html) wraps envs that nobody made for relgym.
