"""Room for the arrays of long motions: files without a name, of which memory holds what is in use.

A motion of a day has millions of samples of two hundred bytes. The files are in the folder for
temporary files (TMPDIR), and gone with their arrays.
"""

import math
import mmap
import os
import tempfile
import weakref
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

LARGE = 2**20  # bytes; below it a file is not worth while

_rooms: "weakref.WeakSet[mmap.mmap]" = weakref.WeakSet()


def room(shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """An array to be filled; a large one in a file, in memory where there is no place for one."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < LARGE:
        return np.empty(shape, dtype)
    try:
        with tempfile.TemporaryFile() as file:
            os.posix_fallocate(file.fileno(), 0, size)
            held = mmap.mmap(file.fileno(), size)
    except (OSError, AttributeError):  # a full disk; or a system that keeps no place for a file
        return np.empty(shape, dtype)
    _rooms.add(held)
    return np.frombuffer(held, dtype).reshape(shape)


def let_go() -> None:
    """Memory is given back of what the files hold; what is used again is read again."""
    for held in list(_rooms):
        held.madvise(mmap.MADV_DONTNEED)
