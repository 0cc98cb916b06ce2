"""A race of methods: what each costs for the same backbone on the same virtual rigs."""
