"""What rolling and torsional friction do to the ball."""
