"""An emulator as a process: settings as JSON on standard input, facts and counts as JSON lines on standard output."""

import json
import os
import sys
from dataclasses import asdict

from rig.emulator.process import Ready, run_emulator
from rig.emulator.settings import EmulatorSettings
from rig.errors import RigError


def _say(what: dict[str, object]) -> None:
    print(json.dumps(what), flush=True)


def _ready(ready: Ready) -> None:
    _say({"ready": asdict(ready)})


def main() -> int:
    """Run the emulator of the settings on standard input."""
    settings = EmulatorSettings.model_validate_json(sys.stdin.readline())
    try:
        counted = run_emulator(settings, _ready, parent=os.getppid())
    except RigError as error:
        _say({"error": type(error).__name__, "message": str(error)})
        return 1
    _say({"counted": counted})
    return 0


if __name__ == "__main__":
    sys.exit(main())
