"""The paper's claims, misprints included, each checked by computation.

What the paper states is in the modules, one a part of it; what is made of it, in claim.py.
"""

from validation.paper import appendix, attractors, from_rest, rolling, straight_lines

CLAIMS = (
    *rolling.CLAIMS,
    *from_rest.CLAIMS,
    *straight_lines.CLAIMS,
    *attractors.CLAIMS,
    *appendix.CLAIMS,
)
