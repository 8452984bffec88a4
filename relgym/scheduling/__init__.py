"""Work in pieces: what would stall a step of the world is done over several, within a budget counted in cells."""
