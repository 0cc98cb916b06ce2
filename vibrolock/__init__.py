"""An open test controller for nonlinear vibration testing.

Begin with `rig`::

    import rig

    run = rig.run("magnet-beam/backbone")    # a shipped plan on a virtual rig
    print(run)
    print(run.backbone())

Four packages are installed together, and are also names of this one, imported when they are used:

    vibrolock.rig               benches, plans, runs, recordings, figures, and the command `rig`
    vibrolock.identification    measurements, models and predictions
    vibrolock.controller        the control law, usable alone
    vibrolock.simulators        the virtual rigs

`vibrolock` itself holds their common parts: its version, the compilation of kernels, names imported on use.
"""

from typing import Any

PACKAGES = ("rig", "identification", "controller", "simulators")
"""The packages of this distribution that do something of their own."""

__version__: str


def __getattr__(name: str) -> Any:
    if name in PACKAGES:
        from importlib import import_module

        return import_module(name)
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; allowed: {', '.join(PACKAGES)}")
    from importlib.metadata import version  # takes longer than everything else that a small command imports

    globals()[name] = found = version("vibrolock")
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *PACKAGES, "__version__"})
