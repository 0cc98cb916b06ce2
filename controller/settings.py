"""The base class of every group of settings in `[controller]`."""

from pydantic import ConfigDict

from vibrolock.described import Described


class Settings(Described):
    """Settings in SI units: validated, frozen, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
