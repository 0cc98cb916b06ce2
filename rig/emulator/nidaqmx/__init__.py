"""An emulated NI gRPC Device Server: NI devices with a virtual rig behind them, for NI's own Python package as client."""
