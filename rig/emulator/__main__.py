"""An emulator as a process: settings as JSON on standard input, facts and counts as JSON lines on standard output."""

import json
import os
import sys
from dataclasses import asdict

from rig.emulator.process import run_emulator
from rig.emulator.settings import EmulatorSettings
from rig.errors import RigError


def _print(**message: object) -> None:
    print(json.dumps(message), flush=True)


def main() -> int:
    """Run the emulator of the settings on standard input."""
    settings = EmulatorSettings.model_validate_json(sys.stdin.readline())
    try:
        counted = run_emulator(settings, lambda ready: _print(ready=asdict(ready)), parent=os.getppid())
    except RigError as error:
        _print(error=type(error).__name__, message=str(error))
        return 1
    _print(counted=counted)
    return 0


if __name__ == "__main__":
    sys.exit(main())
