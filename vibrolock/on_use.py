"""Names of a package, and entries of a registry, that are imported on first use: importing the package itself costs nothing."""

import ast
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, TypeVar

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


def on_use(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` (PEP 562) and ``__all__`` of a package whose names are imported when they are used.

    The names are those that the package imports where type checkers look; its source is read for them, so that each stands
    there once, marked as exported by ``as``::

        if TYPE_CHECKING:
            from controller.law import Law as Law
        else:
            __getattr__, __dir__, __all__ = on_use(__name__)

    ``help`` of such a package prints its docstring, which is therefore where the names are introduced. `pydoc` finds what it
    prints by `inspect.getmembers`, which would import every name; all classes in full are 8500 lines for ``identification``.
    """
    module_of = module_of_names(Path(str(sys.modules[package].__file__)).read_text(encoding="utf-8"))

    def get(name: str) -> Any:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(module_of[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        own = vars(sys.modules[package]).keys() - module_of.keys() - {"TYPE_CHECKING", on_use.__name__}
        for_inspect = sys._getframe(1).f_globals.get("__name__") == "inspect"
        return sorted(own if for_inspect else {*own, *module_of})

    return get, names, sorted(module_of)


def module_of_names(source: str) -> dict[str, str]:
    """Return the module of each name that a package imports under ``if TYPE_CHECKING``."""
    for statement in ast.parse(source).body:
        match statement:
            case ast.If(test=ast.Name(id="TYPE_CHECKING"), body=imports):
                return {
                    name.name: str(line.module)
                    for line in imports
                    if isinstance(line, ast.ImportFrom)
                    for name in line.names
                }
    return {}
