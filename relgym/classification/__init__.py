"""Preconditions: when does a mode hold, and which objects its roles are bound to (§3.4, §3.5)."""
