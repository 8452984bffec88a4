"""What the commands of ``relgym`` do, behind the declarations of their options in `relgym.cli`."""
