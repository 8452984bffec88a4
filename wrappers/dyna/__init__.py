"""Agents that train in what they have learned, whatever trains them: a model beside the agent, and dreams.

Public names are those of `relgym.wrappers.sb3`, which joins them to Stable-Baselines3; nothing here knows it.
"""
