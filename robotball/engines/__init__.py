"""The engines, a file or a folder each, none of which knows another.

`robotball.engine` lists them.
"""

from collections.abc import Callable

Progress = Callable[[float], None]
"""Called with the fraction of the work that is done."""
