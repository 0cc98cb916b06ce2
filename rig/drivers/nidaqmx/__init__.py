"""Devices of NI through NI-DAQmx (package ``nidaqmx``)."""
