"""Gymnasium wrappers that learn a model of the env they wrap; imported as ``relgym.wrappers``."""

if __name__ != "relgym.wrappers":
    raise ImportError(
        f"this package is called relgym.wrappers, not {__name__!r}: a second copy of every class would "
        "follow; use `from relgym.wrappers import …`"
    )
