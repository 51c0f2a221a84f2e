"""Tell chaos from regular motion by Lyapunov exponents: python examples/exponents.py."""

import robotball as rb

for name in ("fig12", "fig14"):
    exponent = rb.exponents(name, 2000.0).largest[0]
    kind = "chaotic" if exponent > 0.02 else "regular"
    print(f"{name}: largest exponent {exponent:.2f} 1/s, {kind}")
