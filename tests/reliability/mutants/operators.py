"""What is changed: every expression of a module that can be another one, as pieces of its source.

Only the operator, name or number itself is replaced, so that all else of a file stays as it is. Left out is what is not
computed with: annotations, decorators, texts, what is raised, type checks, ``strict``, ``if TYPE_CHECKING``, ``__all__``.
"""

import ast
import re
from typing import NamedTuple

COMPARED = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: (r"is\s+not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: (r"not\s+in", ("in",)),
}
"""Comparisons: how they are written, and what takes their place; of an order its boundary and its contrary."""
ARITHMETIC = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "/"),
    ast.Mod: ("%", "//"),
    ast.Pow: ("**", "*"),
    ast.MatMult: ("@", "*"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.BitXor: ("^", "|"),
}
SWAPPED = {
    one: other
    for pair in (("min", "max"), ("minimum", "maximum"), ("argmin", "argmax"))
    for one, other in (pair, pair[::-1])
}
OF_TYPES = {"isinstance", "issubclass", "cast", "TypeVar", "Literal"}
SHOWN = 40
"""Characters of a statement that are shown on either side of what is changed in it."""


class Change(NamedTuple):
    """One expression of a module and what takes its place."""

    operator: str
    """``comparison``, ``arithmetic``, ``logic``, ``sign``, ``number``, ``truth``, ``extreme``, ``loop``."""
    function: str
    """Qualified name of the function or class that it stands in; ``<module>`` outside."""
    line: int
    begin: int
    """First byte that is replaced; ``end`` is behind the last one."""
    end: int
    text: str
    before: str
    """The statement around it, in one line; long ones in part."""
    after: str


def changed(source: str, change: Change) -> str:
    """The module with one expression changed.

    Raises:
        ValueError: it reads as before, or as no Python.
    """
    data = source.encode()
    other = (data[: change.begin] + change.text.encode() + data[change.end :]).decode()
    try:
        same = ast.dump(ast.parse(other)) == ast.dump(ast.parse(source))
    except SyntaxError as error:
        raise ValueError(f"{change.before} -> {change.after}: {error}") from error
    if same:
        raise ValueError(f"{change.before} -> {change.after}: nothing is changed")
    return other


def changes(source: str) -> list[Change]:
    """Every change that can be made in a module, in the order of its text."""
    finder = _Finder(source)
    finder.visit(ast.parse(source))
    return sorted(finder.found, key=lambda one: (one.begin, one.text))


class _Finder(ast.NodeVisitor):
    """Walks through a module and notes what can be changed."""

    def __init__(self, source: str) -> None:
        self.found: list[Change] = []
        self._data = source.encode()
        self._lines = [0]
        for line in self._data.splitlines(keepends=True):
            self._lines.append(self._lines[-1] + len(line))
        self._names: list[str] = []
        self._functions = 0
        self._statement: ast.stmt | None = None

    def visit(self, node: ast.AST) -> None:
        """Visit what counts; remember the innermost statement."""
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom) or _is_of_types(node):
            return
        around, self._statement = self._statement, node if isinstance(node, ast.stmt) else self._statement
        super().visit(node)
        self._statement = around

    def _each(self, nodes: list[ast.expr | None] | list[ast.expr] | list[ast.stmt]) -> None:
        for node in nodes:
            if node is not None:
                self.visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        """Values of arguments, and the body."""
        self._names.append(node.name)
        self._functions += 1
        self._each([*node.args.defaults, *node.args.kw_defaults])
        self._each(node.body)
        self._functions -= 1
        self._names.pop()

    visit_AsyncFunctionDef = visit_FunctionDef  # noqa: N815

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """The body alone."""
        self._names.append(node.name)
        self._each(node.body)
        self._names.pop()

    def visit_If(self, node: ast.If) -> None:
        """Not what only type checkers and the command line read."""
        test = ast.unparse(node.test)
        if test.endswith("TYPE_CHECKING"):
            self._each(node.orelse)
        elif not test.startswith("__name__"):
            self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        """Not the list of public names."""
        if ast.unparse(node.targets[0]) not in ("__all__", "__version__"):
            self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """Not the annotation; not a type with a name."""
        if node.value is not None and not ast.unparse(node.annotation).endswith("TypeAlias"):
            self._each([node.target, node.value])

    def visit_Match(self, node: ast.Match) -> None:
        """Not the patterns."""
        self.visit(node.subject)
        for case in node.cases:
            self._each(case.body)

    def visit_Compare(self, node: ast.Compare) -> None:
        """Every comparison of a chain by itself."""
        sides = [node.left, *node.comparators]
        for left, how, right in zip(sides, node.ops, sides[1:], strict=False):
            written, others = COMPARED[type(how)]
            for other in others:
                self._note_between("comparison", written, other, left, right)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        """Every ``and`` and ``or`` by itself."""
        written, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._note_between("logic", written, other, left, right)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """Arithmetic; not of texts and paths, nor of types outside functions."""
        of_types = isinstance(node.op, ast.BitOr) and not self._functions
        if not of_types and not _is_text(node.left) and not _is_text(node.right):
            written, other = ARITHMETIC[type(node.op)]
            self._note_between("arithmetic", re.escape(written), other, node.left, node.right)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """Arithmetic in place."""
        if not _is_text(node.value):
            written, other = ARITHMETIC[type(node.op)]
            self._note_between("arithmetic", re.escape(written) + "=", other + "=", node.target, node.value)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """A minus or a ``not`` is left out."""
        for kind, operator, length in ((ast.USub, "sign", 1), (ast.Not, "logic", 4)):
            if isinstance(node.op, kind):
                begin = self._at(node)[0]
                self._note(operator, node.lineno, begin, begin + length, "")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """Numbers grow by one, truth turns round."""
        begin, end = self._at(node)
        if isinstance(node.value, bool):
            self._note("truth", node.lineno, begin, end, repr(not node.value))
        elif isinstance(node.value, int | float):
            self._note("number", node.lineno, begin, end, repr(node.value + 1))
        elif isinstance(node.value, complex):
            self._note("number", node.lineno, begin, end, repr(node.value + 1j))

    def visit_Call(self, node: ast.Call) -> None:
        """The smallest becomes the largest."""
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in SWAPPED:
            end = self._at(node.func)[1]
            self._note("extreme", node.func.end_lineno or node.lineno, end - len(name), end, SWAPPED[name])
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        """Not ``strict`` of ``zip``, which checks what is so anyway."""
        if node.arg != "strict":
            self.generic_visit(node)

    def visit_Break(self, node: ast.Break) -> None:
        """A loop goes on."""
        self._note("loop", node.lineno, *self._at(node), "continue")

    def visit_Continue(self, node: ast.Continue) -> None:
        """A loop ends."""
        self._note("loop", node.lineno, *self._at(node), "break")

    def _at(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        begin = self._lines[node.lineno - 1] + node.col_offset
        return begin, self._lines[(node.end_lineno or 1) - 1] + (node.end_col_offset or 0)

    def _note_between(self, operator: str, written: str, other: str, left: ast.expr, right: ast.expr) -> None:
        """Note what is written between two expressions, where there may also be brackets and comments."""
        begin, end = self._at(left)[1], self._at(right)[0]
        word = rf"\b{written}\b" if written[-1].isalpha() else written
        for found in re.finditer(rb"#[^\n]*|(?P<it>" + word.encode() + rb")", self._data[begin:end]):
            if found["it"]:
                line = self._data.count(b"\n", 0, begin + found.start()) + 1
                self._note(operator, line, begin + found.start(), begin + found.end(), other)
                return

    def _note(self, operator: str, line: int, begin: int, end: int, text: str) -> None:
        first, last = self._statement_at()
        head, tail = _in_one_line(self._data[first:begin]), _in_one_line(self._data[end:last])
        head = "…" + head[-SHOWN:] if len(head) > SHOWN + 1 else head
        tail = tail[:SHOWN] + "…" if len(tail) > SHOWN + 1 else tail
        old = self._data[begin:end].decode()
        function = ".".join(self._names) or "<module>"
        before, after = (f"{head}{one}{tail}".strip() for one in (old, text))
        self.found.append(Change(operator, function, line, begin, end, text, before, after))

    def _statement_at(self) -> tuple[int, int]:
        """Where the innermost statement stands; of one with a body what comes before that."""
        assert self._statement is not None
        first, last = self._at(self._statement)
        body = getattr(self._statement, "body", None)
        if isinstance(self._statement, ast.Match):
            last = self._at(self._statement.subject)[1]
        elif body:
            last = self._at(body[0])[0]
        return first, last


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str | bytes))


def _is_of_types(node: ast.AST) -> bool:
    """Whether a call or a subscript is about types."""
    name = node.func if isinstance(node, ast.Call) else node.value if isinstance(node, ast.Subscript) else None
    return isinstance(name, ast.Name) and name.id in OF_TYPES


def _in_one_line(data: bytes) -> str:
    return re.sub(r"\s+", " ", re.sub(r"  # [^\n]*", "", data.decode()))
