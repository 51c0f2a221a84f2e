"""The paper's statements in its order, misprints included, each checked by computation.

A section of the paper is a module; a claim becomes a finding in claim.py. The means of checking are
formulas.py, the paper's formulas typed a second time; point_masses.py, a ball by Newton and Euler
alone; engine_ball.py, MuJoCo's ball; captions.py, the numbers that the captions print.
"""

from validation.paper import (
    appendix_a,
    ours,
    section_1,
    section_2,
    section_3,
    section_4,
    section_4_2,
    section_5_1,
    section_5_2,
    section_5_3,
)
from validation.paper.claim import Section

OURS = "Ours, not the paper's"
SECTIONS = (
    Section("1. Introduction", section_1.CLAIMS),
    Section("2. Equations of motion", section_2.CLAIMS),
    Section("3.1. Rolling without slipping and spinning (rubber model)", section_3.CLAIMS_3_1),
    Section("3.2. Rolling without slipping (classical model)", section_3.CLAIMS_3_2),
    Section("3.3. Reconstruction", section_3.CLAIMS_3_3),
    Section("4. Motion from rest", section_4.CLAIMS_4),
    Section("4.1. K = 0", section_4.CLAIMS_4_1),
    Section("4.2. K ≠ 0", section_4_2.CLAIMS),
    Section("5.1. Straight-line motions", section_5_1.CLAIMS),
    Section("5.2. Poincaré map", section_5_2.CLAIMS),
    Section("5.3. Attractors", section_5_3.CLAIMS),
    Section("Appendix A", appendix_a.CLAIMS),
    Section(OURS, ours.CLAIMS_OURS + ours.CLAIMS_NUMBERS + ours.CLAIMS_BALLS),
)
