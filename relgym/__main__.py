"""``python -m relgym`` is the command ``relgym``, for where scripts aren't on the path."""

from relgym.cli import app

if __name__ == "__main__":
    app(prog_name="relgym")
