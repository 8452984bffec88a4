"""Preconditions: when does a mode hold, and which objects play its roles (§3.4, §3.5)."""
