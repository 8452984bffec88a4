"""Learning from transitions: one, many, a bounded memory of them, and back if it fails half way."""
