"""Who wants to know that kernels are compiled; a module of its own, for commands that load nothing else."""

from collections.abc import Callable

on_compiling: list[Callable[[str], None]] = []
"""Called with the name of each kernel that is about to be compiled, for it is not in the cache."""
