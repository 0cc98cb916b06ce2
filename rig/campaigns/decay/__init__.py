"""Kind of campaign: settle at phase resonance, take the output to 0 V at once, record the decay."""
