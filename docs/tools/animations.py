"""Draws the pictures that move on the envs' pages, with the envs' own rendering; each takes seconds.

Run: python docs/tools/animations.py            # all of them, into docs/envs
     python docs/tools/animations.py truck-push
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import TimeLimit
from PIL import Image, ImageDraw, ImageFont

from relgym.envs import LearnedModelEnv
from relgym.envs.scripted import ball_home, deliver, push_knowing
from relgym.wrappers import ActionRepeat, ModelLearner

FOLDER = Path(__file__).resolve().parents[1] / "envs"
WIDTH = 560
"""Of a picture, in pixels."""

Frames = Iterator[Image.Image]


def ball_box_ramp() -> Frames:
    """Two episodes: from above the box, and from the floor."""
    env = gym.make("relgym/BallBoxRamp-v0", render_mode="rgb_array")
    for seed, ball in ((3, "above-left"), (8, "leftmost")):
        env.reset(seed=seed, options={"ball": ball, "direction": "right", "ramp": "right"})
        yield from _watched(env, lambda: 0, every=3)


def truck_push() -> Frames:
    """Three episodes of the scripted policy that knows which boxes rest on the ground."""
    env = gym.make("relgym/TruckPush-v0", render_mode="rgb_array")
    for layout in (1, 2, 4):
        env.reset(seed=layout, options={"layout": layout})
        yield from _watched(env, lambda: push_knowing(env.get_wrapper_attr("scene")), every=1)


def ball_goal() -> Frames:
    """One episode of the scripted policy, which bounces over what is in the way."""
    env = gym.make("relgym/BallGoal-v0", render_mode="rgb_array")
    env.reset(seed=4)
    yield from _watched(env, lambda: ball_home(env.get_wrapper_attr("scene")), every=4)


def box_push() -> Frames:
    """Two episodes of the scripted policy: a box and a T are delivered."""
    for seed, parcel in ((3, "box"), (9, "tee")):
        env = gym.make("relgym/BoxPush-v0", n_boxes=3, parcel=parcel, render_mode="rgb_array")
        env.reset(seed=seed, options={"count": 3})
        yield from _watched(ActionRepeat(env, 10), partial(_delivering, env), every=1)


def _delivering(env: gym.Env[Any, Any]) -> Any:
    return deliver(env.get_wrapper_attr("scene"))


def learned_model() -> Frames:
    """A ball in the world and, beside it, in a model that has watched 4,000 steps of other scenes."""
    watched = ModelLearner(gym.make("relgym/BallBoxRamp-v0"))
    watched.reset(seed=0)
    for _ in range(4_000):
        *_, truncated, _ = watched.step(0)
        if truncated:
            watched.reset()
    real = gym.make("relgym/BallBoxRamp-v0", render_mode="rgb_array")
    real.reset(
        seed=1_003, options={"ball": "between", "ramp": "left", "touching": False, "ball_floor": False}
    )
    start = real.get_wrapper_attr("scene")
    model = TimeLimit(LearnedModelEnv(watched.model, like=real, render_mode="rgb_array"), 200)
    model.reset(options={"scene": start})
    for left, right in zip(
        _watched(real, lambda: 0, every=3), _watched(model, lambda: 0, every=3), strict=False
    ):
        yield _beside(left, "the env", right, "the model, from the first scene on")


ANIMATIONS: dict[str, tuple[Callable[[], Frames], int]] = {
    "ball-box-ramp": (ball_box_ramp, 40),
    "ball-goal": (ball_goal, 40),
    "box-push": (box_push, 80),
    "learned-model": (learned_model, 40),
    "truck-push": (truck_push, 140),
}
"""File → what it shows, and for how many milliseconds each frame stays."""


def write(name: str, folder: Path = FOLDER) -> Path:
    """Draw one of them and save it as an animated WebP."""
    draw, milliseconds = ANIMATIONS[name]
    first, *others = draw()
    path = folder / f"{name}.webp"
    first.save(path, save_all=True, append_images=others, duration=milliseconds, loop=0, quality=55, method=6)
    return path


def _watched(env: gym.Env[Any, Any], policy: Callable[[], Any], *, every: int) -> Frames:
    """Frames of one episode; its end stays for a while."""
    done, step = False, 0
    while not done:
        if step % every == 0:
            yield _frame(env)
        *_, terminated, truncated, _ = env.step(policy())
        done, step = terminated or truncated, step + 1
    yield from [_frame(env)] * 6


def _frame(env: gym.Env[Any, Any]) -> Image.Image:
    image = Image.fromarray(np.asarray(env.render()))
    return image.resize((WIDTH, image.height * WIDTH // image.width), Image.Resampling.LANCZOS)


def _beside(left: Image.Image, title: str, right: Image.Image, other: str) -> Image.Image:
    width, height = WIDTH // 2, left.height // 2
    both = Image.new("RGB", (2 * width, height + 24), "white")
    pen = ImageDraw.Draw(both)
    for x, image, text in ((0, left, title), (width, right, other)):
        both.paste(image.resize((width - 4, height), Image.Resampling.LANCZOS), (x, 24))
        pen.text((x + 6, 3), text, fill=(45, 52, 60), font=ImageFont.load_default(14))
    return both


if __name__ == "__main__":
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    for wanted in sys.argv[1:] or ANIMATIONS:
        written = write(wanted)
        print(f"{written.name}: {written.stat().st_size // 1000} kB")
