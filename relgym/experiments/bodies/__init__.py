"""Bodies that push, turn and stack: worlds, trials, and parcels delivered."""
