"""``rig conformance``: the DAQ contract over an installed driver."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from rig.cli.options import Json


def conformance(
    bench: Annotated[str, typer.Option(help="Bench whose driver is tested: a shipped name or TOML file.")],
    daq: Annotated[str | None, typer.Option(help="Driver to use instead of the bench's, without its options.")] = None,
    arm: Annotated[bool, typer.Option("--arm", help="Let something physical move, by up to 0.05 V.")] = False,
    output_log: Annotated[
        Path | None,
        typer.Option(help="What an emulator writes down of its output (rig emulate --log-output): a witness."),
    ] = None,
    json: Json = False,
) -> None:
    """Test an installed driver against the contract that every driver keeps; say at the end what is unproven, and why."""
    from rig.bench import DriverChoice, load_bench
    from rig.conformance.run import OUTCOMES, check_driver, require_arming, unproven
    from rig.show.waiting import heard
    from rig.text.console import print_json

    chosen = load_bench(bench)
    if daq is not None and daq != chosen.driver.name:
        chosen = chosen.model_copy(update={"driver": DriverChoice(name=daq)})
    require_arming(chosen, arm)
    found = []
    for finding in check_driver(chosen, output_log):
        found.append(finding)
        heard()
        if not json:
            print(
                f"{finding.outcome:14} {finding.test}" + (f": {finding.detail}" if finding.detail else ""), flush=True
            )
    failed = sum(finding.outcome == "failed" for finding in found)
    if json:
        print_json({"bench": chosen.name, "driver": chosen.driver.name, "tests": [asdict(f) for f in found]})
    else:
        counts = [f"{sum(one.outcome == outcome for one in found)} {outcome}" for outcome in OUTCOMES]
        print(f"driver {chosen.driver.name}: {', '.join(counts)}")
        for reason, tests in unproven(found).items():
            print(f"unproven: {', '.join(tests)}: {reason}")
    if failed:
        raise typer.Exit(1)
