"""The thesis' experiments as data: blocks of transitions with their ground truth, and the analytic modes."""
