"""The compiled program of a model: lowered from what was learned, kept while that holds, and run."""
