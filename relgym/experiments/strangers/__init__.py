"""Other people's worlds with nothing tuned to them, and small ones by the textbook."""
