"""The `robotball` command, as installed and as `python -m robotball`."""

from robotball import validation_package


def main() -> None:
    """Run the command of the validation package, wherever that lies."""
    validation_package(".__main__").main()


if __name__ == "__main__":
    main()
