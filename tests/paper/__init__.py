"""The paper's statements in its order, misprints included, each checked by computation.

A module has one section of the paper or several; a claim becomes a finding in claim.py. The means
of checking are formulas.py, the paper's formulas typed a second time; point_masses.py, a ball by
Newton and Euler alone; engine_ball.py, MuJoCo's ball; captions.py, the captions' numbers. Where
robotball has a formula of its own, its value is held beside the paper's by the same row.
"""

from tests.paper import (
    test_appendix_a_bodies as appendix_a,
)
from tests.paper import (
    test_section_1_introduction as section_1,
)
from tests.paper import (
    test_section_2_equations_of_motion as section_2,
)
from tests.paper import (
    test_section_3_momentum as section_3,
)
from tests.paper import (
    test_section_4_1_without_k as section_4,
)
from tests.paper import (
    test_section_4_2_with_k as section_4_2,
)
from tests.paper import (
    test_section_5_1_straight_lines as section_5,
)
from tests.paper import (
    test_section_5_3_attractors as section_5_3,
)

SECTIONS = (
    section_1.SECTION,
    section_2.SECTION,
    section_3.RUBBER_MODEL,
    section_3.CLASSICAL_MODEL,
    section_3.RECONSTRUCTION,
    section_4.SECTION,
    section_4.SECTION_4_1,
    section_4_2.SECTION,
    section_5.SECTION_5_1,
    section_5.SECTION_5_2,
    section_5_3.SECTION,
    appendix_a.SECTION,
)
