"""What vibrates: beams by finite elements, lap joints, modes that are given."""
