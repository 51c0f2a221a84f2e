"""robotball: a rolling ball run by contact engines and by the paper's equations, side by side."""

import lazy_loader

# What is named in __init__.pyi is loaded when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
