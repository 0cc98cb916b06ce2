"""Directives of the reference, filled from the code, and the list of words by which ``rig docs`` finds a page.

- ``{keys} settle``: the table of keys of a table of a plan, bench or virtual rig
- ``{command-help} run``: usage, arguments and options of a command
- ``{names} identification`` with one name a line: their summary and their documentation
- ``{error-tree} rig.errors.RigError``: an error and those derived from it
"""

import inspect
from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from textwrap import indent
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from typer.main import get_command

from rig.cli.app import app as command_line
from rig.reference.commands import command_entries, commands_of, option_names
from rig.reference.entry import Entry
from rig.reference.keys import key_entries, keys_of, tables
from rig.reference.messages import PAGES, message_entries
from rig.reference.names import documentation, first_line, name_entries
from rig.reference.words import words_of, write_words
from rig.text.message_pages import page_of

COMMANDS = {command.name: command for command in commands_of(get_command(command_line))}


class Generated(SphinxDirective):
    """A directive whose content is made as Markdown."""

    required_arguments = 1
    final_argument_whitespace = True

    def parsed(self, lines: Iterable[str]) -> list[nodes.Node]:
        """Return lines of Markdown as nodes."""
        holder = nodes.container()
        self.state.nested_parse(StringList(list(lines), self.env.docname), self.content_offset, holder)
        return list(holder.children)

    def target(self, kind: str, name: str, anchor: str) -> nodes.Node:
        """Return the place where a thing stands, which the search, the inventory and links then know."""
        node = nodes.target("", "", ids=[anchor])
        standard = self.env.domains.standard_domain
        if kind != "option":
            standard.note_object(kind, name, anchor, location=node)
        standard.anonlabels[anchor] = (self.env.docname, anchor)
        standard.labels[anchor] = (self.env.docname, anchor, name)
        return node


class Keys(Generated):
    """The keys of a table: key, default, allowed, meaning."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        name = self.arguments[0]
        if name not in tables():
            raise self.error(f"there is no table {name!r}: {', '.join(tables())}")
        out = self.parsed(self._markdown(name))
        for table in out:
            table["classes"].append("keys")
        cells = [row[0] for table in out for body in table.findall(nodes.tbody) for row in body]
        for key, cell in zip(keys_of(name), cells, strict=True):
            cell.insert(0, self.target("key", f"{name}.{key.name}", key.anchor))
        return [self.target("table", name, f"keys-{name}"), *out]

    @staticmethod
    def _markdown(name: str) -> Iterator[str]:
        yield from ("| key | default | allowed | meaning |", "|---|---|---|---|")
        for key in keys_of(name):
            links = ", ".join(f"[{table}](#keys-{table})" for table in key.holds)
            allowed = f"{key.allowed}: {links}" if links else key.allowed
            cells = (f"`{key.name}`", key.default or "–", allowed, key.meaning)
            yield "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"


class CommandHelp(Generated):
    """What a command does, its arguments and its options."""

    def run(self) -> list[nodes.Node]:
        """Return them as paragraphs and lists."""
        command = COMMANDS.get(f"rig {self.arguments[0]}")
        if command is None:
            raise self.error(f"there is no command rig {self.arguments[0]}")
        lines = [command.text, "", "```text", command.usage, "```", ""]
        for names, text in (*command.arguments, *command.options):
            lines += [f"`{names}`", f": {text or '–'}", ""]
        out = self.parsed(lines)
        terms = [term for part in out for term in part.findall(nodes.term)]
        for (names, _), term in zip((*command.arguments, *command.options), terms, strict=True):
            for option in option_names(names):
                term.insert(0, self.target("option", f"{command.name} {option}", f"{command.anchor}{option}"))
        return [self.target("command", command.name, f"command-{command.anchor}"), *out]


class Names(Generated):
    """Public names of a module: a table with a line each, then each in full."""

    has_content = True
    option_spec: ClassVar = {"no-summary": directives.flag}

    def run(self) -> list[nodes.Node]:
        """Return what autodoc makes of the names."""
        module, names = self.arguments[0], [line.strip() for line in self.content if line.strip()]
        lines = ["````{eval-rst}", f".. currentmodule:: {module}", ""]
        if "no-summary" not in self.options:
            lines += [".. list-table::", "   :widths: 30 70", ""]
            for name in names:
                lines += [f"   * - :py:obj:`{name} <{module}.{name}>`", f"     - {first_line(module, name)}"]
            lines += [""]
        for name in names:
            lines += _documented(module, name)
        return self.parsed([*lines, "````"])


class ErrorTree(Generated):
    """An error and those that are derived from it in the same module, as a nested list."""

    def run(self) -> list[nodes.Node]:
        """Return the list."""
        module, _, name = self.arguments[0].rpartition(".")
        return self.parsed(self._branch(getattr(import_module(module), name), ""))

    def _branch(self, error: type, indent: str) -> Iterator[str]:
        page = f"{PAGES}/{page_of(error.__name__)}"
        more = f" ([what to do](/{page}.md))" if page in self.env.found_docs else ""
        name, module = error.__name__, error.__module__
        yield f"{indent}- {{py:exc}}`{name} <{module}.{name}>`: {first_line(module, name)}{more}"
        for one in error.__subclasses__():
            if one.__module__ == error.__module__:
                yield from self._branch(one, f"{indent}  ")


def _documented(module: str, name: str) -> list[str]:
    thing = getattr(import_module(module), name)
    full = f"{module}.{name}"
    if isinstance(thing, type) and issubclass(thing, Exception):
        return [f".. autoexception:: {full}", "   :show-inheritance:", ""]
    if isinstance(thing, type):
        return [f".. autoclass:: {full}", "   :members:", "   :exclude-members: model_config, model_post_init", ""]
    if inspect.isroutine(thing):
        return [f".. autofunction:: {full}", ""]
    value = [f"   :value: {thing!r}"] if isinstance(thing, int | str) else []
    return [f".. py:data:: {name}", *value, "", *indent(documentation(module, name), "   ").splitlines(), ""]


def _without_fields(app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str, returns: str) -> Any:
    """Leave out the signature of a class that is built from keys, whose fields are listed below it."""
    return ("", None) if hasattr(thing, "model_fields") else None


def _by_public_name(app: Sphinx, env: Any, node: Any, content: Any) -> Any:
    """Resolve a name that was imported from where it is defined to the page of its public name."""
    if node.get("refdomain") != "py":
        return None
    last = node["reftarget"].rpartition(".")[2]
    python = env.domains.python_domain
    found = [name for name in python.objects if name == last or name.endswith(f".{last}")]
    short = [name for name in found if name.rpartition(".")[2][:1].isupper() == last[:1].isupper()]
    if len(short) != 1:
        return None
    return python.resolve_xref(env, node["refdoc"], app.builder, "obj", short[0], node, content)


def _site_entries(app: Sphinx) -> Iterator[tuple[Entry, str]]:
    """Yield every entry with its address: those of the code, then pages, messages and terms of the site."""
    address = app.builder.get_target_uri
    python = app.env.domains.python_domain.objects
    labels = app.env.domains.standard_domain.anonlabels
    entries = [*key_entries(), *command_entries(get_command(command_line)), *message_entries(), *name_entries()]
    for entry in entries:
        if entry.target in labels:
            page, anchor = labels[entry.target]
            yield entry, f"{address(page)}#{anchor}"
        elif entry.target in python:
            yield entry, f"{address(python[entry.target].docname)}#{python[entry.target].node_id}"
        elif entry.target in app.env.found_docs:
            title = app.env.titles[entry.target].astext()
            yield replace(entry, words=(*entry.words, title)), address(entry.target)
        elif entry.what == "message":
            yield entry, ""
    known = {entry.target for entry in entries}
    words = {word for entry in entries for word in entry.words}
    for page in sorted(app.env.found_docs - known):
        title = app.env.titles[page].astext()
        what = "message" if page.startswith(PAGES) else "page"
        stem = page.rpartition("/")[2]
        yield Entry(what, page, (title, *({stem} - words - {"index"})), title, page), address(page)
    for name, _, kind, page, anchor, _ in app.env.domains.standard_domain.get_objects():
        if kind == "term":
            yield Entry("term", name, (name,), f"{name}, in the glossary", anchor), f"{address(page)}#{anchor}"


def _write_words(app: Sphinx, error: Exception | None) -> None:
    if error is None and app.builder.name == "html":
        write_words(words_of(_site_entries(app)), Path(app.outdir))


def setup(app: Sphinx) -> dict[str, Any]:
    """Add directives, kinds of objects and the list of words."""
    for kind in ("key", "table", "command"):
        app.add_object_type(kind, kind, objname=kind)
    app.registry.domain_object_types["std"]["table"].attrs["searchprio"] = 0  # before the keys that hold the table
    app.add_directive("keys", Keys)
    app.add_directive("command-help", CommandHelp)
    app.add_directive("names", Names)
    app.add_directive("error-tree", ErrorTree)
    app.connect("autodoc-process-signature", _without_fields)
    app.connect("missing-reference", _by_public_name)
    app.connect("build-finished", _write_words)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
