"""Qualitative dynamics: equilibria, cycles, sections, tori, exponents, drift and basins."""
