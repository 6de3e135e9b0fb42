"""Linearised equations of the zoo, springs added, against extrapolated differences of its accelerations."""
