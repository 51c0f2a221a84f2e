"""Error against processor time, over many configurations."""
