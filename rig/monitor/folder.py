"""The recordings and models of a folder, with figures and tables. Each file has a number; a request names nothing else.

Files are read in child processes, one at a time and with limited time and memory: a damaged or huge one spoils nothing.
"""

import asyncio
import json
import sys
from collections import OrderedDict
from pathlib import Path
from typing import NamedTuple

from rig.recording.journal import journal_path
from rig.system.child import ChildFailed, child_environment
from rig.text.json_values import JsonValue

MOST_FILES = 500
"""So many files are listed, the youngest."""
MOST_KEPT = 64  # figures and tables that are kept; chosen
LARGEST_BYTES = 16 * 2**20  # bytes of a figure or table; chosen
CHILD = "rig.monitor.folder_child"
TIMEOUT_S = {"kinds": 20.0, "figure": 120.0, "table": 60.0}
AT_ONCE = 50  # files that one child looks into; chosen
SUFFIX = ".h5"


class _Version(NamedTuple):
    name: str
    modified_ns: int
    size: int


class Folder:
    """A folder."""

    def __init__(self, path: Path) -> None:
        self._path = path.absolute()
        self._numbers: dict[str, int] = {}  # for good: another listing does not change them
        self._kinds: dict[_Version, dict[str, str]] = {}
        self._kept: OrderedDict[tuple[str, _Version], bytes] = OrderedDict()
        self._one_at_a_time = asyncio.Lock()

    async def entries(self) -> list[dict[str, JsonValue]]:
        """Return the files, the youngest first: number, name, kind, when modified (s since 1970), bytes, what it is."""
        found = await asyncio.to_thread(self._found)
        async with self._one_at_a_time:
            await self._look_into([version for version in found if version not in self._kinds])
        self._kinds = {version: self._kinds[version] for version in found}
        for version in found:
            self._numbers.setdefault(version.name, len(self._numbers))
        return [
            {
                "n": self._numbers[version.name],
                "name": version.name,
                "modified": 1e-9 * version.modified_ns,
                "size": version.size,
                **self._kinds[version],
            }
            for version in found
        ]

    async def made(self, what: str, number: int) -> bytes:
        """Return the "figure" (PNG) or the "table" (text) of a file.

        Raises:
            KeyError: no file has this number.
            ChildFailed: it cannot be made.
        """
        name = next((name for name, its in self._numbers.items() if its == number), None)
        if name is None:
            raise KeyError(number)
        version = self._version(name)
        if version is None:
            raise KeyError(number)
        async with self._one_at_a_time:
            if (what, version) not in self._kept:
                self._kept[what, version] = await _ask(what, str(self._path / name))
            self._kept.move_to_end((what, version))
            while len(self._kept) > MOST_KEPT:
                self._kept.popitem(last=False)
            return self._kept[what, version]

    def _found(self) -> list[_Version]:
        """Return the recordings and models, also recordings that are still journals; links are left alone."""
        try:
            names = {path.name.removesuffix(".journal") for path in self._path.iterdir() if not path.is_symlink()}
        except OSError:
            return []
        versions = [self._version(name) for name in names if name.endswith(SUFFIX)]
        found = [version for version in versions if version is not None]
        return sorted(found, key=lambda version: version.modified_ns, reverse=True)[:MOST_FILES]

    def _version(self, name: str) -> _Version | None:
        for path in (self._path / name, journal_path(self._path / name)):
            if path.is_file() and not path.is_symlink():
                state = path.stat()
                return _Version(name, state.st_mtime_ns, state.st_size)
        return None

    async def _look_into(self, versions: list[_Version]) -> None:
        """Find out the kinds of files. Where one of many makes the child fail, they are looked into one by one."""
        for first in range(0, len(versions), AT_ONCE):
            some = versions[first : first + AT_ONCE]
            if not await self._look_at(some) and len(some) > 1:
                for one in some:
                    await self._look_at([one])

    async def _look_at(self, versions: list[_Version]) -> bool:
        try:
            answer = json.loads(await _ask("kinds", *(str(self._path / version.name) for version in versions)))
            self._kinds |= dict(zip(versions, answer, strict=True))
        except (ChildFailed, ValueError) as error:
            self._kinds |= {
                version: {"kind": "unreadable", "summary": f"cannot be read: {error}"} for version in versions
            }
            return False
        return True


async def _ask(what: str, *arguments: str) -> bytes:
    """Return what the child answers; raise ChildFailed with its own words, or with how it ended."""
    timeout_s = TIMEOUT_S[what]
    child = await asyncio.create_subprocess_exec(
        *(sys.executable, "-P", "-m", CHILD, what, *arguments, f"{timeout_s:.0f}"),
        stdin=asyncio.subprocess.PIPE,  # never written to: its end tells the child that this process has ended
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        env=child_environment(),
    )
    assert child.stdout is not None
    try:
        async with asyncio.timeout(timeout_s):
            answer = await child.stdout.read(1)
            while more := await child.stdout.read(1 << 16):
                answer += more
                if len(answer) > LARGEST_BYTES:
                    raise ChildFailed("it is too large")
            status = await child.wait()
    except TimeoutError:
        raise ChildFailed(f"it takes more than {timeout_s:.0f} s") from None
    finally:
        if child.returncode is None:
            child.kill()
            await child.wait()
    if status:
        raise ChildFailed(
            answer.decode("utf-8", "replace") if status == 1 and answer else f"its reader crashed ({status})"
        )
    return answer
