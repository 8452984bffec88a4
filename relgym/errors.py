"""Every error relgym raises on purpose; each message says what was expected, what came, and what to do."""

__all__ = [
    "ActionError",
    "ClusterError",
    "ConfigError",
    "DataError",
    "ModelFileError",
    "ObservationError",
    "QueryError",
    "RelgymError",
    "SchemaError",
    "ShapeError",
    "SlowWarning",
    "StoreError",
]


class RelgymError(Exception):
    """Base of all errors that relgym raises on purpose."""


class ConfigError(RelgymError, ValueError):
    """Raised when a configuration value, option or argument is outside its documented range."""


class SchemaError(RelgymError, ValueError):
    """Raised when a schema is inconsistent, or a scene doesn't match the schema it claims to follow."""


class ShapeError(RelgymError, ValueError):
    """Raised when a shape can't be used: not convex, degenerate, or of a non-positive size."""


class ObservationError(RelgymError, ValueError):
    """Raised when an observation holds NaN or infinity, a wrong length, or an unknown object or type."""


class DataError(RelgymError, ValueError):
    """Raised when recorded data can't be learned from: lengths that differ, NaN, other dtypes, nothing in it."""


class ActionError(RelgymError, ValueError):
    """Raised when an action lies outside its action space."""


class ModelFileError(RelgymError, ValueError):
    """Raised when a model file is truncated, edited, of another version, or not a relgym model at all."""


class QueryError(RelgymError, LookupError):
    """Raised when a model is asked about a target, object or type that it doesn't know."""


class ClusterError(RelgymError, ConnectionError):
    """Raised when no cluster answers at the given address."""


class StoreError(RelgymError, OSError):
    """Raised when a kept result is damaged or missing, or can't be written (no space left, no permission)."""


class SlowWarning(RuntimeWarning):
    """Warns once that something that makes relgym fast is missing: results are the same, later."""
