"""The validation layer: motions of a contact engine and of the equations compared, and studied."""

import lazy_loader

# What is named in __init__.pyi is loaded when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
