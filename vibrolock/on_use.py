"""Names of a package that are imported on first use, so that importing the package itself costs nothing."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

__all__ = ["on_use"]


def on_use(package: str, module_of: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` (PEP 562) of a package whose names lie in modules below it.

    ``module_of`` is the module of each name, relative to the package. A package calls it where type checkers do not look, for
    them a module with ``__getattr__`` has every name::

        if TYPE_CHECKING:
            from controller.law import Law
        else:
            __getattr__, __dir__ = on_use(__name__, {"Law": "law"})

    ``help`` of such a package prints its docstring, which is therefore where the names are introduced. `pydoc` finds what it
    prints by `inspect.getmembers`, which would import every name; all classes in full are 8500 lines for ``identification``.
    """

    def get(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(f"{package}.{module_of[name]}"), name)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        own = vars(sys.modules[package]).keys() - module_of.keys()
        for_inspect = sys._getframe(1).f_globals.get("__name__") == "inspect"
        return sorted(own if for_inspect else {*own, *module_of})

    return get, names
