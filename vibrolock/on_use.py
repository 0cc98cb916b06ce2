"""Names of a package, and entries of a registry, that are imported on first use: importing the package itself costs nothing."""

import sys
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pkgutil import resolve_name
from typing import Any, TypeVar

__all__ = ["Registry", "on_use"]

T = TypeVar("T")


class Registry(Mapping[str, T]):
    """Objects by name, each imported from its address ``module:object`` when it is asked for."""

    def __init__(self, addresses: Mapping[str, str]) -> None:
        self._addresses = addresses

    def __getitem__(self, name: str) -> T:
        found: T = resolve_name(self._addresses[name])
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._addresses)

    def __len__(self) -> int:
        return len(self._addresses)

    def __contains__(self, name: object) -> bool:
        return name in self._addresses


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
