"""Modes, §3.2: discovery, roles, assignment and unification."""
