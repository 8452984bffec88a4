"""The thesis' own system: chapter III as printed, and the program behind its experiments; nothing here is relgym's."""
