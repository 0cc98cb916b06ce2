"""The command ``rig``, with one file per subcommand."""

from rig.cli.app import app, main

__all__ = ["app", "main"]
