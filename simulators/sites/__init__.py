"""Local nonlinear sites: elements without memory, friction joints, functions of the user's own."""
