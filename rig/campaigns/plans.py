"""Plans by name or from TOML files."""

from importlib import resources
from pathlib import Path

from rig.bench import Bench, load_bench
from rig.campaigns.backbone import BackbonePlan
from rig.configuration import read_toml, validated
from rig.errors import ConfigurationError

__all__ = ["bench_of", "load_plan", "shipped_plans"]

KINDS = {"backbone": BackbonePlan}


def _folder() -> Path:
    return Path(str(resources.files("rig"))) / "plans"


def shipped_plans() -> list[str]:
    """Names ``<bench>/<campaign>`` of the plans that come with the product."""
    return sorted(path.relative_to(_folder()).with_suffix("").as_posix() for path in _folder().rglob("*.toml"))


def load_plan(name_or_path: str | Path) -> BackbonePlan:
    """A shipped plan by its name, or a plan from a TOML file; `ConfigurationError` names what is wrong with it."""
    text = str(name_or_path)
    path = Path(text)
    if path.suffix != ".toml":
        if text not in shipped_plans():
            raise ConfigurationError(
                f"plan = {text!r}: there is no such plan; allowed is {', '.join(shipped_plans())} or a .toml file"
            )
        path = _folder() / f"{text}.toml"
    table = read_toml(path)
    kind = table.get("kind")
    if kind not in KINDS:
        raise ConfigurationError(f"{text}: kind = {kind!r}: allowed is {', '.join(map(repr, KINDS))}")
    return validated(KINDS[kind], table, text)


def bench_of(plan: BackbonePlan, plan_source: str | Path) -> Bench:
    """The bench that a plan names; a relative file is looked for beside the plan's own file."""
    if plan.bench.endswith(".toml") and not Path(plan.bench).is_absolute() and Path(str(plan_source)).suffix == ".toml":
        return load_bench(Path(str(plan_source)).parent / plan.bench)
    return load_bench(plan.bench)
