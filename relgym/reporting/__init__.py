"""The model as text: rule lists, the language they are written in, a parser, and what they say of scenes.

Nothing here knows how models are learned: records come in, text goes out, and text comes in again.
"""
