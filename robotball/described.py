"""What a key of a scene file says, told beside the key: the reader and docs/scene.md share it."""

import msgspec


def key(meaning: str, unit: str = "") -> msgspec.Meta:
    """The meaning of a key in a line of Markdown, and its unit; for `Annotated`."""
    return msgspec.Meta(description=meaning, extra={"unit": unit})
