"""What a bench is: driver, rate, channels, limits and the facts known of the specimen; read from TOML."""

from rig.bench.bench import (
    Arming,
    Bench,
    DriverChoice,
    EmergencyStop,
    Limits,
    SpecimenFacts,
    load_bench,
    shipped_benches,
)

__all__ = [
    "Arming",
    "Bench",
    "DriverChoice",
    "EmergencyStop",
    "Limits",
    "SpecimenFacts",
    "load_bench",
    "shipped_benches",
]
