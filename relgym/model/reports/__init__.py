"""What a model tells people: tables, rule lists, explanations, advice."""
