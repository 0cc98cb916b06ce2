"""What depends on what: the imports that grimp finds, and those that stand in no import statement."""

import ast
import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import grimp

from vibrolock.on_use import module_of_names

PRODUCT = ("vibrolock", "rig", "controller", "simulators", "identification")
PACKAGES = (*PRODUCT, "benchmarks", "studies", "tests")

_OF_RESULTS = ("rig.figures", "rig.show")
"""What draws and shows results, registered for `vibrolock.results`."""
_SHOWN = (".plot(", "_repr_")
_MODULE = rf"((?:{'|'.join(PACKAGES)})(?:\.\w+)+)"
_NAMED = re.compile(rf"\b{_MODULE}(\.\{{)?")
_ADDRESS = re.compile(rf"[\"']{_MODULE}(?:[\"':]|(\.\{{))")
_STRING = r'"""(?:\\.|[^\\])*?"""|"(?:\\.|[^"\\\n])*"'
_NO_CODE = re.compile(rf"(?<!\w)([A-Za-z]{{0,2}})({_STRING}|{_STRING.replace(chr(34), chr(39))})|#[^\n]*", re.DOTALL)
_FIXTURE = re.compile(r"^@pytest\.fixture[^\n]*\ndef (\w+)", re.MULTILINE)
_FROM = re.compile(r"\bfrom +(\w+) +import +(?:\(([^)]*)\)|([^\n;]*))")
_IMPORT = re.compile(r"\bimport +((?:[\w.]+(?: +as +\w+)?, *)*[\w.]+(?: +as +\w+)?)")


def import_graph(root: Path) -> grimp.ImportGraph:
    """Return the imports of all packages; those in functions and for type checkers count."""
    return grimp.build_graph(*PACKAGES, cache_dir=str(root / ".import_linter_cache"))


def sources(graph: grimp.ImportGraph, root: Path) -> dict[str, str]:
    """Return the text of every module."""
    return {module: _file(module, root).read_text(encoding="utf-8") for module in graph.modules}


def _file(module: str, root: Path) -> Path:
    path = root.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


def drivers(root: Path) -> list[str]:
    """Return the modules that `rig.drivers` finds as entry points."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return [address.partition(":")[0] for address in project["entry-points"]["vibrolock.drivers"].values()]


def complete(graph: grimp.ImportGraph, text: Mapping[str, str], drivers: list[str]) -> None:
    """Add to the imports what they do not say.

    - Whoever imports a module runs the packages around it, without what these import on use.
    - A name that a package imports on use leads to its module; a package that is handed on as a whole leads to all of them.
    - Strings that are the address of a module, of something in it, or of any module in a package, count as imports. In a test
      they may stand anywhere in a string: in scripts, commands and patches.
    - A test runs the `conftest.py` of its folder and of those around it, and the installed plugin's package.
    - Whoever names a fixture of a plugin that `tests/conftest.py` lists imports that plugin; `tests/conftest.py` does not.
    - Drivers are entry points, and a result that draws or shows itself needs figures and tables.
    """
    product = (module for module in text if module.startswith(PRODUCT))
    on_use = {module: names for module in product if (names := _names_on_use(text[module]))}
    for package, module_of in on_use.items():
        _part(graph, text, package, module_of)
    modules = graph.modules
    hidden = [("rig.drivers", name) for name in drivers] + [("rig.reference.names", name) for name in PRODUCT]
    hidden.append(("tests.conftest", "rig.__init__"))
    for module, own in text.items():
        for package in packages_around(module):
            hidden.append((module, f"{package}.__init__" if package in on_use else package))
            if module.startswith("tests."):
                hidden.append((module, f"{package}.conftest"))
        if module == "vibrolock.results" or module.startswith("tests.changed."):
            continue
        testing = module.startswith(("tests.", "benchmarks.", "studies."))
        hidden += [(module, name) for name in _named(_NAMED if testing else _ADDRESS, own, modules, graph)]
        if testing and any(word in own for word in _SHOWN):
            hidden += [(module, name) for name in _OF_RESULTS]
    plugins = {name: text[name] for name in _listed_plugins(text.get("tests.conftest", "")) if name in text}
    hidden = [
        (importer, imported)
        for importer, imported in hidden
        if (importer, imported) != ("tests.conftest", imported) or imported not in plugins
    ]
    for plugin, own in plugins.items():
        if fixtures := _FIXTURE.findall(own):
            named = re.compile(rf"\bdef \w+\([^)]*\b(?:{'|'.join(fixtures)})\b")
            hidden += [
                (module, plugin) for module in text if module.startswith("tests.") and named.search(text[module])
            ]
    for importer, imported in hidden:
        if importer != imported and {importer, imported} <= modules:
            graph.add_import(importer=importer, imported=imported)


def _listed_plugins(text: str) -> list[str]:
    """Return the modules in ``pytest_plugins``."""
    found = re.search(r"^pytest_plugins = (\[.*?\])", text, re.MULTILINE | re.DOTALL)
    return list(ast.literal_eval(found[1])) if found else []


def packages_around(module: str) -> Iterator[str]:
    """Yield the packages around a module, from the innermost one."""
    while "." in module:
        module = module.rpartition(".")[0]
        yield module


def _names_on_use(text: str) -> dict[str, str]:
    """Return the names that a package imports on use (`on_use`), with their modules."""
    return module_of_names(text) if "__dir__, __all__ = on_use(__name__)" in text else {}


def _part(graph: grimp.ImportGraph, text: Mapping[str, str], package: str, module_of: Mapping[str, str]) -> None:
    """Part what a package imports when it is itself imported, as `package.__init__`, from what it imports on use."""
    inner = f"{package}.__init__"
    graph.add_module(inner)
    for imported in graph.find_modules_directly_imported_by(package) - set(module_of.values()):
        graph.add_import(importer=inner, imported=imported)
    graph.add_import(importer=package, imported=inner)
    if "." in package:
        return  # whoever uses such a package uses all of it
    imported_there = re.compile(rf"import [^\n]*\b{package}\b")
    for module, own in text.items():
        if f"from {package} import" not in own and not imported_there.search(own):
            continue
        used = used_names(own if module.startswith("tests.") else without_strings(own), package)
        if used is not None and graph.direct_import_exists(importer=module, imported=package):
            graph.remove_import(importer=module, imported=package)
            graph.add_import(importer=module, imported=inner)
        for imported in [package] if used is None else [module_of[name] for name in used & module_of.keys()]:
            graph.add_import(importer=module, imported=imported)


def used_names(text: str, package: str) -> set[str] | None:
    """Return the names that a module takes from a package; None if it hands the package on as a whole.

    Scripts in strings count; one that imports the package is taken to use it as a whole.
    """
    taken = ("".join(names) for whence, *names in _FROM.findall(text) if whence == package)
    used = {name for names in taken for name in re.findall(r"(\w+|\*)(?: +as +\w+)?", names)}
    code = without_strings(text)
    local = _local_names(code, package)
    if "*" in used or len(_local_names(text, package)) > len(local):
        return None
    for name in {*local}:
        uses = re.findall(rf"(?<![\w.]){name}\b(?!\s*=[^=])(?:\s*\.\s*(\w+))?", _IMPORT.sub("", code))
        if "" in uses:
            return None
        used |= {*uses}
    return used


@cache
def without_strings(text: str) -> str:
    """Return code without strings and comments; f-strings, which may hold code, are left."""
    return _NO_CODE.sub(lambda found: found[0] if "f" in (found[1] or "").lower() else '""', text)


def _local_names(text: str, package: str) -> list[str]:
    """Return the names under which a text imports a package, or a module below it with the package."""
    found = []
    for imported in _IMPORT.findall(text):
        for name, _, alias in (each.strip().partition(" as ") for each in imported.split(",")):
            if name == package or (not alias and name.startswith(f"{package}.")):
                found.append(alias.strip() or package)
    return found


def _named(pattern: re.Pattern[str], text: str, modules: set[str], graph: grimp.ImportGraph) -> Iterator[str]:
    """Yield the modules that a pattern finds in a text; a package may be run, or any of its modules be meant."""
    for name, any_in_it in {*pattern.findall(text)}:
        module = next((part for part in (name, *packages_around(name)) if part in modules), "")
        if "." in module:
            yield from (module, f"{module}.__main__", *(graph.find_descendants(module) if any_in_it else ()))
