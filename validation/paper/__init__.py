"""The paper's statements in its order, misprints included, each checked by computation.

A section of the paper is a module, or two; what is made of a claim is in claim.py. formulas.py has
the paper's formulas, typed a second time; point_masses.py a ball that knows only Newton and Euler;
engine.py MuJoCo's ball; captions.py what the captions print.
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
    Section("2. Equations of motion", section_2.CLAIMS_KINEMATICS + section_2.CLAIMS_EQUATIONS),
    Section("3.1. Rolling without slipping and spinning (rubber model)", section_3.CLAIMS_3_1),
    Section("3.2. Rolling without slipping (classical model)", section_3.CLAIMS_3_2),
    Section("3.3. Reconstruction", section_3.CLAIMS_3_3),
    Section("4. Motion from rest", section_4.CLAIMS_4),
    Section("4.1. K = 0", section_4.CLAIMS_4_1 + section_4.CLAIMS_4_1_ORBITS),
    Section("4.2. K ≠ 0", section_4_2.CLAIMS),
    Section("5.1. Straight-line motions", section_5_1.CLAIMS),
    Section("5.2. Poincaré map", section_5_2.CLAIMS),
    Section("5.3. Attractors", section_5_3.CLAIMS_5_3 + section_5_3.CLAIMS_5_3_PATHS),
    Section("Appendix A", appendix_a.CLAIMS),
    Section(OURS, ours.CLAIMS_OURS + ours.CLAIMS_NUMBERS + ours.CLAIMS_BALLS),
)
