"""What can be known of a virtual bench without a test: linear modes and responses, and vibrations by harmonic balance.

Every analysis is a function of a `rig.analysis.subject.Subject` in a file of its own, and gives a `rig.analysis.study.Study`
that can be printed, drawn and turned into JSON. The physics is that of `simulators.analysis`.
"""
