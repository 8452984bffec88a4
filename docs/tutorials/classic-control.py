# %% [markdown]
# # Wrap CartPole and MountainCar
#
# `ModelLearner` takes any Gymnasium env with flat spaces. This notebook starts with one line, reads what the
# model says it lacks, and ends with the equations in the envs' sources.

# %%
import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

from relgym.wrappers import ModelLearner, NumbersView, Part


def watch(env, steps):
    """Act at random, and return the learner."""
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(steps):
        *_, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    return env


# %% [markdown]
# ## MountainCar
#
# Two numbers without names become one object, `self`, with the properties `x0` and `x1`.

# %%
plain = watch(ModelLearner(gym.make("MountainCar-v0")), 1_000)
print(plain.model.describe(digits=4))

# %% [markdown]
# The position is explained: it goes on by the *next* velocity. The velocity isn't. The model has found a line
# that leaves less than 1 % of its change, says so, and names the features with which a law explains all of it. So we
# switch those on, and give the numbers names.

# %%
car = gym.make("MountainCar-v0")
view = NumbersView(car.observation_space, car.action_space, names=("x", "v"))
curved = watch(ModelLearner(car, view=view, config={"features": ("trig",)}), 1_000)
print(curved.model.describe(digits=4))

# %% [markdown]
# That is the line in the env's source. How far are both off, on steps they haven't seen?


# %%
def errors(learner, env, steps=500):
    """Errors of the velocity, one step ahead, on fresh episodes."""
    env.action_space.seed(1)
    observation, _ = env.reset(seed=1_000)
    found = []
    for _ in range(steps):
        action = env.action_space.sample()
        predicted = learner.predict(observation, action).scene["self"].values[1]
        observation, _, terminated, truncated, _ = env.step(action)
        found.append(abs(predicted - observation[1]))
        if terminated or truncated:
            observation, _ = env.reset()
    return np.array(found)


bins = np.logspace(-10, -3, 50)
for learner, label in ((plain, "a line"), (curved, "with trig")):
    plt.hist(errors(learner, gym.make("MountainCar-v0")) + 1e-10, bins, histtype="step", label=label)
plt.gcf().set_size_inches(7, 2.5)
plt.xscale("log")
plt.xlabel("error of the next velocity (observations are float32)")
plt.ylabel("steps")
_ = plt.legend()
# %% [markdown]
# ## CartPole
#
# Four numbers that belong to two things. `Part` says which; each part is an object with a name of its own,
# and what is learned may speak of the other one's properties. `actions` names the choices.

# %%
pole = gym.make("CartPole-v1")
view = NumbersView(
    pole.observation_space,
    pole.action_space,
    names=("x", "x_dot", "theta", "theta_dot"),
    parts=[Part("cart", ("x", "x_dot")), Part("pole", ("theta", "theta_dot"))],
    actions=("left", "right"),
)
model = watch(ModelLearner(pole, view=view), 1_500).model
for target in model.targets:
    for mode in model.modes(target.type, target.property):
        print(f"{target!s:15} {mode.examples:5} transitions:  {mode.formula(4)}")

# %% [markdown]
# The positions follow exactly from the velocities. The velocities of CartPole are no linear functions of
# these numbers: what the model found there is an approximation, which `describe` would say, with the spread
# (±) of what it leaves and the features that would explain more.
#
# ## Reward and termination
#
# are properties of an object `task`, if you ask for them. Then the learned model is a whole env:

# %%
task = watch(ModelLearner(gym.make("CartPole-v1"), learn_reward=True, learn_termination=True), 600)
for mode in task.model.modes("task", "reward"):
    print(mode.examples, "transitions:", mode.formula(3))
for mode in task.model.modes("task", "terminated"):
    print(mode.examples, "transitions:", mode.formula(3))

# %% [markdown]
# [Your own env](../guides/your-own-env.html) goes on from here: angles, walls, tables of objects, views of
# your own, vector envs. [The next tutorial](learned-model.html) acts inside a learned model.
