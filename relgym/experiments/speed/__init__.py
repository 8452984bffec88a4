"""Time and memory: steps of learning, sizes of worlds, roll-outs."""
