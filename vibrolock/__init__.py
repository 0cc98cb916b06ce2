"""Common parts of the four packages of this distribution: its version and the compilation of kernels."""

from importlib.metadata import version

__version__ = version("vibrolock")
