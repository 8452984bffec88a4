"""The thesis' worlds: accuracy, cost, learning online, noise."""
