"""Load plans by name or from TOML files."""

from collections.abc import Mapping
from importlib import resources
from pathlib import Path

from rig.bench import Bench, load_bench
from rig.bench.configuration import find_toml, read_toml, shipped_names, validated
from rig.campaigns.kinds import KINDS
from rig.campaigns.planning.plan import Plan
from rig.errors import ConfigurationError


def _folder() -> Path:
    return Path(str(resources.files("rig.campaigns"))) / "shipped"


FORMER_KEYS = {"accepted_alien_force": "accepted_nonharmonic_force"}
"""Keys of plans of earlier versions, with their names of today."""


def shipped_plans() -> list[str]:
    """Return the names ``<bench>/<campaign>`` of the plans that come with the product."""
    return shipped_names(_folder())


def load_plan(name_or_path: str | Path) -> Plan:
    """Load a shipped plan by name, or a plan from a TOML file; raise `ConfigurationError` that names the error in it."""
    text = str(name_or_path)
    if Path(text).suffix == ".h5":
        raise ConfigurationError(
            "is a file of results, which a plan makes",
            field="plan",
            value=text,
            allowed="the name of a plan or a .toml file",
            hint="a recording is shown by rig show, rig plot and rig replay, finished by rig resume, and made into a model by "
            "rig identify",
        )
    return plan_from(read_toml(find_toml(name_or_path, _folder(), "plan")), text)


def plan_from(table: Mapping[str, object], source: str) -> Plan:
    """Build a plan of any kind from its table; raise `ConfigurationError` that names the error and the ``source``."""
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise ConfigurationError(where=source, field="kind", value=kind, allowed=KINDS)
    table = {FORMER_KEYS.get(key, key): value for key, value in table.items()}
    return validated(KINDS[kind].plan, table, source)


def bench_of(plan: Plan, plan_source: str | Path) -> Bench:
    """Load the bench that a plan names. A relative path is relative to the folder of the plan's file."""
    if plan.bench.endswith(".toml") and not Path(plan.bench).is_absolute() and Path(str(plan_source)).suffix == ".toml":
        return load_bench(Path(str(plan_source)).parent / plan.bench)
    return load_bench(plan.bench)
