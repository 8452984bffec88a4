# %% [markdown]
# # Plan and train in a learned model
#
# A learned model is a Gymnasium env again. So whatever works in an env works in what was learned of it:
# stepping thousands of copies as arrays, planning, and training agents. Here a truck is to push three boxes
# to a goal and stop there. We learn its world from random pushes, and plan in the model without a single step
# in the real env.

# %%
import time

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

from relgym.envs import LearnedModelVectorEnv
from relgym.wrappers import ModelLearner

real = gym.make("relgym/TruckPush-v0", render_mode="rgb_array")
real.reset(seed=3, options={"layout": 2})
plt.figure(figsize=(6, 3.75))
plt.imshow(real.render())
_ = plt.axis("off")
# %% [markdown]
# ## Learn the world
#
# A thousand random pushes. What counts here is the curve: after a few hundred steps no prediction is wrong any
# more.

# %%
learner = ModelLearner(gym.make("relgym/TruckPush-v0"))
learner.action_space.seed(0)
learner.reset(seed=0)
wrong = []
for _ in range(1_000):
    *_, terminated, truncated, info = learner.step(learner.action_space.sample())
    wrong.append(bool(info["relgym"].wrong))
    if terminated or truncated:
        learner.reset()

plt.figure(figsize=(7, 2.5))
plt.plot(np.cumsum(wrong))
plt.xlabel("real steps")
plt.ylabel("wrong or abstained, in all")
model = learner.model
for mode in model.modes("truck", "vx"):
    print(mode.formula(3), f"   ({mode.examples} transitions)")

# %% [markdown]
# ## Many futures at once
#
# `LearnedModelVectorEnv` steps many copies of a learned env by arrays. `like=real` gives it the real env's
# spaces and task, which pays imagined steps as it pays real ones.

# %%
PLANS = 2_048
dreams = LearnedModelVectorEnv(model, num_envs=PLANS, like=real, autoreset_mode="Disabled")


def returns(scene, plans):
    """What each plan would earn from a scene on, by the model; plans: shape (plans, steps)."""
    dreams.reset(options={"scene": scene})
    total, going = np.zeros(len(plans)), np.ones(len(plans), dtype=bool)
    for actions in plans.T:
        _, reward, terminated, truncated, _ = dreams.step(actions[:, None].astype(np.float32))
        total += np.where(going, reward, 0.0)
        going &= ~(terminated | truncated)
        if not going.any():
            break
        if not going.all():  # those that ended begin anew, and aren't counted
            dreams.reset(options={"scene": scene, "reset_mask": ~going})
    return total


start = real.get_wrapper_attr("scene")
began = time.perf_counter()
returns(start, np.ones((PLANS, 10)))
print(f"{PLANS * 10 / (time.perf_counter() - began):,.0f} imagined steps a second")

# %% [markdown]
# ## Plan
#
# Plans of two numbers: push so hard, for so many steps, then let the boxes' friction stop the truck. We draw
# 2,048 of them, imagine each, and carry out the best one in the real env, with closed eyes.


# %%
def best_plan(scene, rng):
    """The best of random plans, by the model; shape (20,)."""
    force = rng.uniform(-1.0, 1.0, (PLANS, 1))
    steps = rng.integers(1, 12, (PLANS, 1))
    plans = np.where(np.arange(20) < steps, force, -1.0)
    earned = returns(scene, plans)
    return plans[earned.argmax()], earned.max()


rng = np.random.default_rng(0)
rows = []
for seed in range(20):
    real.reset(seed=10_000 + seed)
    plan, expected = best_plan(real.get_wrapper_attr("scene"), rng)
    earned, done, path = 0.0, False, []
    for action in plan:
        observation, reward, terminated, truncated, info = real.step(np.float32([action]))
        earned += reward
        path.append(observation["goal"][-1])
        if terminated or truncated:
            break
    rows.append((expected, earned, info["is_success"], path))

print(f"goal reached in {sum(bool(row[2]) for row in rows)} of {len(rows)} episodes")
apart = max(abs(expected - earned) for expected, earned, *_ in rows)
print(f"earned otherwise than imagined by at most {apart:.1e}")

# %%
plt.figure(figsize=(7, 2.5))
for _, _, success, path in rows:
    plt.plot(path, color="tab:green" if success else "tab:red", alpha=0.6)
plt.axhspan(-1, 1, color="gold", alpha=0.4)
plt.xlabel("steps")
_ = plt.ylabel("to the goal (units)")

# %% [markdown]
# ## Learn a policy in it
#
# A planner thinks at each decision; a policy does so once. [Dyna](../guides/dyna.html) trains agents of
# Stable-Baselines3 in a model while it is being learned, checks each real step whether the model may be
# believed, and measures what that is worth: [about a tenth of the real steps](../results/dream.html) that SAC
# needs by itself.
