"""The plan that tests rehearse: two levels of the magnet beam by voltage, a second of rig time each."""

import tomllib

from rig.bench import load_bench
from rig.campaigns.plans import load_plan, plan_from

PLAN = load_plan("magnet-beam/backbone")
SHORT_TEXT = """
kind = "backbone"
bench = "magnet-beam"
levels_v = [0.4, 0.8]
record_periods = 8

[controller]
low_pass_rad_s = 6.283
k1 = 2.0
k2 = 6.283
centre_frequency_hz = 24.0
frequency_window_hz = [22.0, 27.0]
"""
SHORT = plan_from(tomllib.loads(SHORT_TEXT), "short plan")


def magnet_beam(**changes):
    return load_bench("magnet-beam").model_copy(update=changes)
