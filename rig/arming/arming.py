"""Arming: permission to move something physical. A virtual rig needs none; any other bench is armed by a person."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from rig.arming.bench_memory import BenchMemory, fingerprint, memory_of, now, remember
from rig.arming.run_facts import calibration_remarks, user_name
from rig.bench import Bench
from rig.bench.cross_checks import cautions as cautions_of_limits
from rig.daq import Capabilities
from rig.errors import NotArmed
from rig.loop.session import Session

CHECK = "check"


@dataclass(frozen=True)
class ArmingRequest:
    """What a person is shown before arming."""

    bench: Bench
    """The bench."""
    what: str
    """Kind of campaign that is to run."""
    identity: dict[str, str]
    """Identity of the device."""
    memory: BenchMemory
    """Last check and last trip of the bench."""
    cautions: tuple[str, ...]
    """Reasons against arming, one line each."""
    unseen: tuple[str, ...] = ()
    """Those reasons that only a person who has seen them can overrule: a trip, or a device that has latched."""
    unguarded: str = ""
    """Why only a person may arm: the output continues if the host dies. Empty if it does not."""

    @property
    def unguarded_refusal(self) -> str:
        """Message that refuses ``arm`` = True, or a bench that arms itself, if the output is ``unguarded``."""
        return (
            f"bench {self.bench.name}: {self.unguarded}; run at a terminal without `arm` and type the bench's name, or test "
            "such a stop and set [arming] hardware_emergency_stop = true"
        )

    def lines(self) -> list[str]:
        """Return the request as lines for the terminal."""
        bench, limits, check = self.bench, self.bench.limits, self.memory.check
        device = ", ".join(f"{key} {value}" for key, value in self.identity.items()) or "unknown"
        last = "never"
        if check is not None:
            verdict = f"failed: {', '.join(check.failed)}" if check.failed else "passed"
            last = f"{_age_h(check.at):.1f} h ago, {verdict} ({check.recording})"
        return [
            f"bench    {bench.name}: {bench.specimen.name}",
            f"device   {bench.driver.name}: {device}",
            f"limits   {limits.voltage_v:g} V, {limits.force_n:g} N, {limits.acceleration_m_s2:g} m/s^2, "
            f"{1e3 * limits.displacement_m:g} mm, {limits.frequency_hz[0]:g} to {limits.frequency_hz[1]:g} Hz",
            f"checked  {last}",
            *(f"CAUTION  {caution}" for caution in self.cautions),
        ]


Arm = bool | Callable[[ArmingRequest], bool] | None
"""Permission to move a rig: given beforehand (True), asked for by a callable, or not given (None, False)."""


def armed(bench: Bench, session: Session, what: str, arm: Arm) -> dict[str, Any]:
    """Arm the bench; return how and by whom, for the record. A person who arms it also clears a remembered trip.

    A virtual rig needs no arming. ``[arming] automated`` arms a bench if there are no reasons against it. ``arm`` True arms it
    unless a trip is remembered or the device has latched, because no person has seen these. Neither suffices if the output
    would continue after the host dies and no hardware emergency stop is declared, or if a calibration is overdue and
    ``[arming] require_calibration`` is true. Raises `NotArmed`, which says how to arm,
    before anything has moved.
    """
    if session.capabilities.virtual:
        return {"how": "virtual", "by": "", "at": now(), "cautions": []}
    overdue = calibration_remarks(bench, datetime.now(UTC).date())
    if bench.arming.require_calibration and overdue and what != CHECK:
        raise NotArmed(f"bench {bench.name}: {'; '.join(overdue)}, and [arming] require_calibration = true")
    memory = memory_of(bench)
    unseen: tuple[str, ...] = () if memory.trip is None else (memory.trip.text,)
    if memory.trip is not None and memory.trip.recording:
        unseen = (f"the last run tripped: {memory.trip.text}",)
    unseen += (session.latched,) if session.latched else ()
    unguarded = unguarded_text(bench, session.capabilities)
    cautions = (*unseen, *filter(None, [unguarded]), *cautions_of(bench, memory, what, session.identity))
    how = _how(ArmingRequest(bench, what, session.identity, memory, cautions, unseen, unguarded), arm)
    if memory.trip is not None and how == "person":
        remember(bench, trip=None)
    return {"how": how, "by": user_name(), "at": now(), "cautions": list(cautions)}


def _how(request: ArmingRequest, arm: Arm) -> str:
    bench = request.bench
    checked = not request.cautions or not bench.arming.require_check
    alone = not request.unseen and not request.unguarded
    if bench.arming.automated and arm is not False and arm is not True and alone and checked:
        return "automated"
    if callable(arm):
        if arm(request):
            return "person"
        raise NotArmed(f"bench {bench.name}: was not armed; nothing has moved")
    if arm and alone:
        return "switch"
    if request.unseen:
        raise NotArmed(
            f"bench {bench.name}: a physical rig would move, and this has not been confirmed: {'; '.join(request.unseen)}; run "
            "at a terminal without `arm` and type the bench's name, or ask with a callable (arm=ask from Python)"
        )
    NotArmed.raise_if(request.unguarded and (arm or bench.arming.automated), request.unguarded_refusal)
    against = f" ({'; '.join(request.cautions)})" if request.cautions else ""
    switch = "" if request.unguarded else ", or give `arm`"
    automated = "" if bench.arming.automated else ", or [arming] automated = true in a bench made for it"
    raise NotArmed(
        f"bench {bench.name}: a physical rig would move, and the bench is not armed{against}; run on a terminal and type the "
        f"bench's name{switch}{automated}"
    )


def cautions_of(bench: Bench, memory: BenchMemory, what: str, identity: Mapping[str, str] | None) -> tuple[str, ...]:
    """Return the reasons against arming for ``what``; those that depend on the device only with its ``identity``.

    Reasons are limits that do not fit the sensors, a missing check, or a check that does not count. For a check itself there
    are none: it moves the rig gently, and finds such faults.
    """
    check = memory.check
    if what == CHECK:
        return ()
    out = list(cautions_of_limits(bench))
    if check is None:
        return ("the bench was never checked: run `rig check` with it", *out)
    if check.failed:
        out.append(f"the last check failed: {', '.join(check.failed)}")
    age_h = _age_h(check.at)
    if age_h < 0.0:
        out.append(f"the last check lies {-age_h:.1f} h ahead of the clock of this computer, so its age is not known")
    if age_h > bench.arming.check_valid_h:
        out.append(f"the last check is {age_h:.1f} h old and is valid for {bench.arming.check_valid_h:g} h")
    if identity is not None and check.fingerprint != fingerprint(bench, identity):
        out.append("the last check was of other channels, another rate, another driver or another device")
    return tuple(out)


def unguarded_text(bench: Bench, capabilities: Capabilities) -> str:
    """Return why a hardware emergency stop is needed; an empty string if it is not.

    A switch on an input channel (``[emergency_stop]``) does not count, because the host reads it and may be dead.
    """
    if capabilities.safe_without_host or bench.arming.hardware_emergency_stop:
        return ""
    return (
        f"driver {bench.driver.name} does not bring the output to 0 V by itself if this computer's process dies: keep a "
        "hardware emergency stop within reach that cuts the amplifier"
    )


def asked_once(arm: Arm) -> Arm:
    """Wrap a permission for several parts of one recording: a person is asked before the first part, and again after a trip."""
    if not callable(arm):
        return arm
    answers: list[bool] = []

    def ask(request: ArmingRequest) -> bool:
        if not answers or request.unseen:
            answers.append(arm(request))
        return answers[-1]

    return ask


def _age_h(at: str) -> float:
    return (datetime.now(UTC) - datetime.fromisoformat(at)).total_seconds() / 3600.0
