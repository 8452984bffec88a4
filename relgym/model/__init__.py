"""The whole: percepts, property models, the world model composed of them, its files and reports."""
