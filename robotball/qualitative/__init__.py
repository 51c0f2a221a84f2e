"""What the ball does: equilibria, cycles, sections, exponents, basins, drift."""
