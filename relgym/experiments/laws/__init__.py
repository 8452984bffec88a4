"""Laws of motion: how they are measured, in the thesis' rooms and in other worlds."""
