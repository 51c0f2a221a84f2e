"""The one exception a user's input can raise."""


class InputError(ValueError):
    """Input that cannot be used; the message is one line: the value, the limit, what to do."""

    def __init__(self, message: str) -> None:
        # A quoted key or a file's name may hold a line break of its own.
        super().__init__(" ".join(message.splitlines()))
