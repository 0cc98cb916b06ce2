"""Whether a page shows what a command prints.

Words are compared, spacing is not; numbers agree within 2 % or 0.02. ``…`` stands for any words, on a line of its own for any
lines. Lines that say what goes on while a command is silent (``[12 s] ...``) depend on the machine and are left out.
"""

import math
import re


def assert_shows(shown: str, printed: str, where: str) -> None:
    """Every line shown is among those printed, in their order; between two of them none is missing but at a ``…``."""
    lines = [line.split() for line in printed.splitlines() if line.strip() and not re.match(r"\[\d+ s\] ", line)]
    at, gap = 0, True
    for line in shown.splitlines():
        words = line.split()
        if words == ["…"]:
            gap = True
            continue
        if not words:
            continue
        reach = range(at, len(lines)) if gap else range(at, min(at + 1, len(lines)))
        found = next((n for n in reach if same(words, lines[n])), None)
        assert found is not None, f"{where}: {line!r} is not what was printed:\n{printed}"
        at, gap = found + 1, False


def same(shown: list[str], printed: list[str]) -> bool:
    """Whether two lines agree word by word: equal, or numbers that are close; ``…`` stands for any words."""
    if not shown or not printed:
        return not printed if not shown else shown == ["…"]
    if shown[0] == "…":
        return any(same(shown[1:], printed[n:]) for n in range(1, len(printed) + 1))
    return (shown[0] == printed[0] or close(shown[0], printed[0])) and same(shown[1:], printed[1:])


def close(a: str, b: str) -> bool:
    """Whether two words are numbers that agree within 2 % or 0.02; another machine may draw other last digits."""
    try:
        return math.isclose(float(a), float(b), rel_tol=0.02, abs_tol=0.02)
    except ValueError:
        return False
