"""How commands fail: one message that says what to do, and an exit status; never a traceback."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperGroup

from relgym.console.suggestions import did_you_mean
from relgym.errors import RelgymError

__all__ = ["STATUS", "Commands"]

STATUS = 2
"""Exit status of commands that were told something wrong."""

_USAGE: type[Exception] = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "UsageError")
"""What a wrong command line raises: typer's own click in new versions, click's in old ones."""


class Commands(TyperGroup):
    """Commands whose foreseeable errors end in a sentence, not in a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command; what relgym, the files and the command line complain of becomes one message."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # whoever read the output has seen enough of it
            raise
        except _USAGE as error:
            _complain(_usage(error, ctx))
        except RelgymError as error:
            _complain(str(error))
        except OSError as error:
            _complain(_of_system(error))
        raise typer.Exit(STATUS) from None


def _complain(message: str) -> None:
    typer.secho(f"relgym: {message}", fg="red", err=True)


def _of_system(error: OSError) -> str:
    if isinstance(error, FileExistsError):  # a folder was to be made there
        return f"{error.filename} is a file, and a folder is needed: name another one"
    if error.filename is None or error.strerror is None:
        return str(error)
    return f"{error.filename}: {error.strerror}; check the path, and that it may be written to"


def _usage(error: Any, ctx: Any) -> str:
    """The library's message, with what was probably meant and what there is."""
    own = getattr(error, "ctx", None) or ctx
    where = own.command_path
    if (wrong := getattr(error, "option_name", None)) is not None and type(error).__name__ == "NoSuchOption":
        known = _options(own)
        return (
            f"{where} has no option {wrong}{did_you_mean(wrong, known)}\n"
            f"Its options: {', '.join(known)}.  More: {where} --help"
        )
    commands = getattr(own.command, "commands", None)
    if commands is not None and (wrong := _unknown_command(error, commands)) is not None:
        return (
            f"there is no command {wrong!r}{did_you_mean(wrong, commands)}\n"
            f"The commands: {', '.join(sorted(commands))}.  More: {where} --help"
        )
    return f"{where}: {error.format_message().rstrip('.')}.\nMore: {where} --help"


def _options(ctx: Any) -> list[str]:
    return sorted({name for param in ctx.command.get_params(ctx) for name in param.opts if name[:2] == "--"})


def _unknown_command(error: Any, commands: Any) -> str | None:
    quoted = str(error.message).split("'")
    return quoted[1] if len(quoted) >= 3 and quoted[1] not in commands else None
