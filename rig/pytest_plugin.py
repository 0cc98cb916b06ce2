"""pytest against a bench: options, fixtures for an armed and safe rig, markers for what a bench must have, a result file.

Every pytest beside which this package is installed loads it: nothing heavy is imported before a fixture is asked for.
"""

from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from rig.bench import Bench
    from rig.daq import DAQ
    from rig.hil.subject import ArmedRig, Subject
    from simulators import VirtualRig

DEFAULT_BENCH = "magnet-beam"
FACTS: "pytest.StashKey[dict[str, object]]" = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options."""
    group = parser.getgroup("rig", "tests on a vibration test bench")
    group.addoption("--rig-bench", metavar="BENCH", help="bench to test: a shipped name or a TOML file")
    group.addoption(
        "--rig-emulate", choices=("serial", "can"), help="reach the (virtual) bench through an emulated device"
    )
    group.addoption("--rig-arm", action="store_true", help="arm a bench on which something physical moves")
    group.addoption(
        "--rig-result", metavar="FILE", help="JSON file to write: bench, device, versions, outcomes, numbers"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Announce the marker; begin the record that goes into the result file."""
    config.addinivalue_line(
        "markers",
        "rig_needs(channels=None, physical=False, virtual=False): what a bench must have, else the test is skipped and says "
        "so; channels: how many, or their names",
    )
    distributed = len(config.getoption("tx", None) or []) > 1  # pytest-xdist's workers, known to its controller only
    if distributed and config.getoption("rig_bench"):
        from rig.hil.subject import refuse_sharing

        refuse_sharing(config.getoption("rig_bench"))
    if config.getoption("rig_result") and not hasattr(config, "workerinput"):
        from rig.hil.results import Results

        config.pluginmanager.register(Results(config.getoption("rig_result")), "rig-results")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Hand on what was tested with the report, for the report may go to another process."""
    report = yield
    facts = item.config.stash.get(FACTS, None)
    if facts is not None:
        report.__dict__["rig_facts"] = facts
    return report


@contextmanager
def _said_in_one_line() -> Iterator[None]:
    """What a bench is refused for is a line for whoever runs the tests; where in the product it was found is not."""
    from rig.errors import RigError

    try:
        yield
    except RigError as error:
        pytest.fail(str(error), pytrace=False)


@pytest.fixture(scope="session")
def rig_subject(pytestconfig: pytest.Config) -> Iterator["Subject"]:
    """What is under test: its bench, device and capabilities. A bench that is missing or out of reach is an error."""
    from rig.hil.subject import subject

    with ExitStack() as stack:
        with _said_in_one_line():
            found = stack.enter_context(
                subject(
                    pytestconfig.getoption("rig_bench") or DEFAULT_BENCH,
                    wire=pytestconfig.getoption("rig_emulate"),
                    arm=pytestconfig.getoption("rig_arm"),
                )
            )
        pytestconfig.stash[FACTS] = found.facts()
        yield found


@pytest.fixture(scope="session")
def rig_bench(rig_subject: "Subject") -> "Bench":
    """The bench."""
    return rig_subject.bench


@pytest.fixture
def rig_daq(rig_subject: "Subject") -> Iterator["DAQ"]:
    """The bench's driver, open; afterwards its output is at 0 V and it is closed. A physical bench has to be armed."""
    from rig.drivers import make_daq

    daq = make_daq(rig_subject.bench)
    with _said_in_one_line():
        rig_subject.require_arming()
        daq.open()
    try:
        with _said_in_one_line():
            daq.clear()
        yield daq
    finally:
        daq.close()


@pytest.fixture(scope="session")
def armed_rig(rig_subject: "Subject") -> Iterator["ArmedRig"]:
    """A rig that carries out plans (``run``), is ramped down after each, however it ends, and let go of at the end."""
    from rig.hil.subject import ArmedRig

    with _said_in_one_line():
        rig_subject.require_arming()
    rig = ArmedRig(rig_subject)
    yield rig
    rig.close()


@pytest.fixture
def rig_truth(rig_subject: "Subject") -> "VirtualRig":
    """The virtual rig behind a virtual or emulated bench, whose own truth is known; a test on any other is skipped."""
    if rig_subject.truth is None:
        pytest.skip(f"bench {rig_subject.bench.name}: a rig whose truth is known is needed, this one is not virtual")
    return rig_subject.truth


@pytest.fixture(autouse=True)
def _rig_needs(request: pytest.FixtureRequest) -> None:
    """Skip where the bench lacks what the test needs; say whose numbers come now."""
    marker = request.node.get_closest_marker("rig_needs")
    if marker is not None:
        lacking = request.getfixturevalue("rig_subject").lacking(**marker.kwargs)
        if lacking:
            pytest.skip(lacking)
    if "armed_rig" in request.fixturenames:
        request.getfixturevalue("armed_rig").properties = request.node.user_properties
