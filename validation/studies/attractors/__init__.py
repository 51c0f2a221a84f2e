"""The attractors of section 5 from MuJoCo's contact model, beside the equations' own."""
