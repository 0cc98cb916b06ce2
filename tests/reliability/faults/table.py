"""The faults as data: what breaks, where, and when. What each does to a voltage stands in `spoiling`."""

from dataclasses import dataclass
from itertools import product


@dataclass(frozen=True)
class Fault:
    """One fault.

    ``part``: a channel's role (force, drive, response), or amplifier, structure, driver. ``onset``: ``start``, before the
    first sample, or ``middle``, halfway through the record of the second point of the run without the fault.
    ``devices``: where it can happen; a wire of counts carries no number that is none, a driver in memory has no cable.
    """

    part: str
    kind: str
    onset: str
    what: str
    devices: tuple[str, ...] = ("virtual", "emulated")

    @property
    def name(self) -> str:
        """Short name, as in the tests' and the page's tables."""
        return f"{self.part}-{self.kind}-{self.onset}"


BOTH = ("start", "middle")
VIRTUAL = ("virtual",)
EMULATED = ("emulated",)

SENSORS = {
    "stuck": "stands at the value it had",
    "open": "open input: 0.2 mV of noise and nothing else",
    "over-range": "reads its full range of 5 V",
    "spikes": "2.5 V for a single sample, every 971 samples",
    "hum": "50 mV of 50 Hz on top",
    "drift": "0.1 V/s on top",
    "x0.1": "a tenth of its sensitivity",
    "x10": "ten times its sensitivity",
    "reversed": "polarity reversed",
}
IN_THE_LOOP = {
    "x0.5": "half of its sensitivity",
    "x2": "twice its sensitivity",
    "fading": "its sensitivity fades by 20 % a second",
    "dropouts": "nothing for 2 ms, every 0.4 s: a loose contact",
}
OF_THE_DRIVE = {
    "2-ms-late": "2 ms late",
    "5-ms-late": "5 ms late",
    "10-ms-late": "10 ms late, as behind an integrating conditioner",
    "swapped": "its cable and that of a response are swapped",
}
NOT_IN_COUNTS = {"nan": "reads NaN", "1e30": "reads 1e30 V"}
AMPLIFIER = {
    "dead": "puts out nothing",
    "x10": "ten times too strong",
    "clipped": "clips at a quarter of the voltage that is needed",
    "held": "holds the last voltage",
}
STRUCTURE = {
    "softer": "20 % less stiff at once",
    "softening": "20 % less stiff within 50 periods",
}
DRIVER = {
    "times-out": ("raises DaqTimeout", VIRTUAL),
    "raises": ("raises an exception that is no DaqError", VIRTUAL),
    "nan-block": ("hands over a block of NaN without an error", VIRTUAL),
    "stale": ("hands over every block 50 samples late", VIRTUAL),
    "repeats": ("hands over its last block again and again", VIRTUAL),
    "skips": ("loses 37 samples once, without an error", VIRTUAL),
    "loses-some": ("loses 1 block of 20, and says so", VIRTUAL),
    "loses-all": ("loses every block, and says so", VIRTUAL),
    "unplugged": ("the cable is unplugged", EMULATED),
    "host-killed": ("the host dies and sends nothing any more", EMULATED),
    "silent": ("the device sends nothing any more", EMULATED),
    "deaf": ("the device understands nothing any more", EMULATED),
    "reset": ("the device restarts", EMULATED),
    "drops-some": ("1 block of 20 is lost on the wire", EMULATED),
    "drops-all": ("every block is lost on the wire", EMULATED),
    "late-block": ("one block comes 50 ms late", EMULATED),
    "emergency-stop": ("the device's emergency stop is pressed", EMULATED),
}

FAULTS: tuple[Fault, ...] = (
    *(
        Fault(role, kind, at, SENSORS[kind])
        for role, kind, at in product(("force", "drive", "response"), SENSORS, BOTH)
    ),
    *(
        Fault(role, kind, at, NOT_IN_COUNTS[kind], VIRTUAL)
        for role, kind, at in product(("force", "drive", "response"), NOT_IN_COUNTS, ("middle",))
    ),
    *(Fault(role, kind, at, IN_THE_LOOP[kind]) for role, kind, at in product(("force", "drive"), IN_THE_LOOP, BOTH)),
    *(Fault("drive", kind, at, OF_THE_DRIVE[kind]) for kind, at in product(OF_THE_DRIVE, BOTH)),
    *(Fault("amplifier", kind, at, AMPLIFIER[kind]) for kind, at in product(("dead", "x10", "clipped"), BOTH)),
    Fault("amplifier", "held", "middle", AMPLIFIER["held"]),
    *(Fault("structure", kind, at, STRUCTURE[kind]) for kind, at in (("softer", "start"), ("softer", "middle"))),
    Fault("structure", "softening", "middle", STRUCTURE["softening"]),
    *(Fault("driver", kind, "middle", what, devices) for kind, (what, devices) in DRIVER.items()),
)


def fault_named(name: str) -> Fault:
    """The fault of a name."""
    return next(fault for fault in FAULTS if fault.name == name)
