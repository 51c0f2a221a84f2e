"""The two shaders that draw balls, floor, paths and shadows, for films and for pages alike.

They are written once, in what GLSL 1.20 and GLSL ES 3.00 have in common but for these names.
"""

from enum import IntEnum
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent


class Kind(IntEnum):
    """What is drawn: how its light is computed."""

    LIT, FLOOR, GLASS, SHADOW, PATH = range(5)


KINDS = "".join(f"#define {kind.name} {kind.value}\n" for kind in Kind)
DESKTOP = (
    "#version 120\n#define ATTRIBUTE attribute\n#define PASSED_ON varying\n"
    "#define PASSED varying\n#define SEEN gl_FragColor\n"
)
PAGE = (
    "#version 300 es\nprecision highp float;\nprecision highp int;\n#define ATTRIBUTE in\n"
    "#define PASSED_ON out\n#define PASSED in\n"
)


def shaders(page: bool = False) -> tuple[str, str]:
    """The vertex and the fragment shader, for a page's WebGL 2 or for OpenGL from 2.1 on."""
    head = (PAGE if page else DESKTOP) + KINDS
    vertex, fragment = ((HERE / f"shade.{name}").read_text("utf-8") for name in ("vert", "frag"))
    return head + vertex, head + ("out vec4 SEEN;\n" if page else "") + fragment


def linked(GL: Any) -> int:
    """The program of both in the OpenGL that is current; raises OSError where it is refused."""
    program = GL.glCreateProgram()
    for kind, text in zip((GL.GL_VERTEX_SHADER, GL.GL_FRAGMENT_SHADER), shaders(), strict=True):
        shader = GL.glCreateShader(kind)
        GL.glShaderSource(shader, text)
        GL.glCompileShader(shader)
        if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
            raise OSError(f"this OpenGL refuses a shader: {GL.glGetShaderInfoLog(shader)!r}")
        GL.glAttachShader(program, shader)
    for index, name in enumerate(("corner", "normal")):
        GL.glBindAttribLocation(program, index, name)
    GL.glLinkProgram(program)
    return int(program)


def framebuffer(GL: Any, size: tuple[int, int], samples: int, *, deep: bool = False) -> int:
    """A framebuffer (height, width) of so many samples a pixel; deep: with depth and stencil.

    Raises OSError where this OpenGL has none.
    """
    height, width = size
    made = int(GL.glGenFramebuffers(1))
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, made)
    wanted = [(GL.GL_RGBA8, GL.GL_COLOR_ATTACHMENT0)]
    if deep:
        wanted.append((GL.GL_DEPTH24_STENCIL8, GL.GL_DEPTH_STENCIL_ATTACHMENT))
    for storage, attachment in wanted:
        buffer = GL.glGenRenderbuffers(1)
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
        GL.glRenderbufferStorageMultisample(GL.GL_RENDERBUFFER, samples, storage, width, height)
        GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, buffer)
    if GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) != GL.GL_FRAMEBUFFER_COMPLETE:
        raise OSError("this OpenGL has no framebuffers to draw a film in")
    return made
