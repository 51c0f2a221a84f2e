"""The validation layer: motions of a contact engine and of the equations compared, and studied."""

import lazy_loader

# Load the names of __init__.pyi at their first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
