"""The thesis' experiments as data: episodes of transitions with their ground truth, and the analytic modes."""
