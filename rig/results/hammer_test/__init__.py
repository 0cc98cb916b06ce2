"""Hammer tests: the hits, and the frequency responses with coherence."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="hammer-test",
    holds=("identification:HammerTest",),
    table="rig.results.hammer_test.views:TABLE",
    draw="rig.results.hammer_test.views:draw_hammer_test",
    figure_in=(9.0, 7.6),
    exported="rig.results.hammer_test.views:exported",
)
