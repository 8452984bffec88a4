"""Models as files: what they hold, how that is checked, and how it is written and read."""
