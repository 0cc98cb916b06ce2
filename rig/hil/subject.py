"""What hardware-in-the-loop tests are run on: a bench that was found, reached and, if it moves anything, armed."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

import rig
from rig.arming.arming import ArmingRequest
from rig.bench import Bench, load_bench
from rig.campaigns.planning.plan import Plan
from rig.daq import Capabilities
from rig.drivers import make_daq
from rig.drivers.virtual import VirtualDAQ
from rig.errors import ConfigurationError, NotArmed
from simulators import VirtualRig

EMULATED_BLOCK_S = 0.004  # a wire carries blocks, no single samples at the rate of a virtual rig


@dataclass(frozen=True)
class Subject:
    """A bench under test. ``truth`` is the virtual rig behind it, if it is one; ``arm`` is the permission to move it."""

    bench: Bench
    capabilities: Capabilities
    identity: dict[str, str]
    truth: VirtualRig | None
    emulated: str | None
    arm: bool

    def require_arming(self) -> None:
        """Raise `NotArmed` where something physical would move and nobody has said that it may."""
        if not self.capabilities.virtual and not self.arm:
            raise NotArmed(f"bench {self.bench.name}: something physical would move; look, then give --rig-arm")

    def lacking(
        self, *, channels: int | Sequence[str] | None = None, physical: bool = False, virtual: bool = False
    ) -> str:
        """What a test needs and the bench lacks, as the reason to skip it; empty if nothing."""
        here = f"bench {self.bench.name}: the test needs"
        names = [channel.name for channel in self.bench.channels]
        if isinstance(channels, int) and len(names) < channels:
            return f"{here} {channels} channels, it has {len(names)}"
        missing = [] if channels is None or isinstance(channels, int) else [n for n in channels if n not in names]
        if missing:
            return f"{here} channel {missing[0]!r}, it has {', '.join(names)}"
        if physical and self.capabilities.virtual:
            return f"{here} something physical, this one is virtual"
        if virtual and not self.capabilities.virtual:
            return f"{here} a virtual rig, on this one something physical moves"
        return ""

    def facts(self) -> dict[str, object]:
        """Bench, driver, device, for the result file."""
        return {
            "bench": self.bench.name,
            "specimen": self.bench.specimen.name,
            "driver": self.bench.driver.name,
            "emulated": self.emulated,
            "virtual": self.capabilities.virtual,
            "armed": self.arm,
            "sample_rate_hz": self.bench.sample_rate_hz,
            "block": self.bench.block,
            "device": self.identity,
        }


def refuse_sharing(name: str | Path) -> None:
    """Raise `pytest.UsageError` where several processes would test one device."""
    try:
        bench = load_bench(name)
    except ConfigurationError:
        return  # what is no bench is refused where it is asked for
    if bench.driver.name != "virtual":
        raise pytest.UsageError(
            f"bench {bench.name}: there is one device behind driver {bench.driver.name!r}, and it is tested by one process; "
            "leave out -n"
        )


@contextmanager
def subject(name: str | Path, *, wire: str | None = None, arm: bool = False) -> Iterator[Subject]:
    """The bench of that name or file, reached once to see that it is there; over an emulated ``wire`` if asked for.

    Raises `ConfigurationError` for what is no bench, or no virtual one where it is to be emulated, `rig.errors.DaqError` for
    one that is out of reach.
    """
    bench = load_bench(name)
    behind = make_daq(bench) if bench.driver.name == "virtual" else None
    truth = behind.rig if isinstance(behind, VirtualDAQ) else None
    if wire is not None and truth is None:
        raise ConfigurationError(
            f"bench {bench.name}: only a virtual bench can be emulated, not driver {bench.driver.name!r}"
        )
    with ExitStack() as stack:
        if wire is not None:
            from rig.emulator.emulated import emulated

            block = max(bench.block, round(EMULATED_BLOCK_S * bench.sample_rate_hz))
            bench = stack.enter_context(emulated(bench.model_copy(update={"block": block}), wire, lockstep=True))
        with make_daq(bench) as daq:
            found = Subject(bench, daq.capabilities, dict(daq.identity), truth, wire, arm)
        yield found


class ArmedRig:
    """Carries out plans on a bench; each run ramps down and closes, whatever happens in it."""

    def __init__(self, subject: Subject) -> None:
        self.bench = subject.bench
        self.properties: list[tuple[str, object]] = []
        self._arm = self._armed if subject.arm else None
        self._runs: list[rig.Run] = []

    def run(self, plan: Plan, *, bench: Bench | None = None, seed: int = 0) -> rig.Run:
        """A finished run of a plan, on the bench or on one with other limits. Ctrl-C in it ends the tests as well."""
        done = rig.run(plan, bench=bench or self.bench, seed=seed, arm=self._arm)
        self._runs.append(done)
        end = done.recording.parts[-1].end
        if end is not None and end["reason"] == "stop_requested":
            raise KeyboardInterrupt("the run was stopped; the rig is ramped down")
        return done

    def _armed(self, request: ArmingRequest) -> bool:
        """Whether ``--rig-arm`` is enough: a trip from before these tests needs a person, one provoked here does not.

        It is a switch, and so never enough where the output would outlive the host.
        """
        if request.unguarded:
            raise NotArmed(request.unguarded_refusal)
        return not request.unseen or bool(self._runs)

    def notes(self, numbers: Mapping[str, object]) -> None:
        """Numbers of the present test for the result file."""
        plain = json.loads(json.dumps(dict(numbers), default=lambda array: array.tolist()))
        self.properties.extend(plain.items())

    def close(self) -> None:
        """Let go of all recordings."""
        while self._runs:
            self._runs.pop().close()
