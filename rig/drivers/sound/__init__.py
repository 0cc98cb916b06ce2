"""Driver ``sound``: any two-way sound device, through PortAudio (extra ``sound``); its class is in the module ``driver``."""
