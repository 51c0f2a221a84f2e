"""Maps of the phase portraits of motion from rest over K₃ and Ω: section 4.2 leaves them open."""
