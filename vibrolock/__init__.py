"""What the four packages of this distribution share: its version and how its kernels are compiled."""

from importlib.metadata import version

__version__ = version("vibrolock")
