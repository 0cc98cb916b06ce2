"""The command ``rig``: one file a command."""

from rig.cli.app import app, main

__all__ = ["app", "main"]
