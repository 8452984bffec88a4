"""Experiments as tasks: cached by content, run by several processes or a cluster, resumed after any interruption."""
