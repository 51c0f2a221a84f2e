"""The one exception a user's input can raise."""


class InputError(ValueError):
    """Input that cannot be used; the message is one line: the value, the limit, what to do."""
