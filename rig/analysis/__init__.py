"""Analyses of a virtual bench without a test: linear modes and responses, and vibrations by harmonic balance.

Every analysis is a function of a `rig.analysis.subject.Subject` in its own file. It returns a `rig.analysis.study.Study`, which
can be printed, drawn and converted to JSON. The physics is in `simulators.analysis`.
"""
