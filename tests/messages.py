"""Check what a message names, and leave its words free.

Facts are the values, limits, options, keys and files of a message, separated by blanks; "~" is a
blank within a fact, as in "5~kg", and "…" any digits. A fact stands alone: 1 is not found in 1.5 or
in 21.
"""

import re
from collections.abc import Sequence


def unnamed(facts: str, message: str) -> list[str]:
    """Return those of the facts that a message does not name."""
    return [fact for fact in facts.split() if not re.search(_alone(fact), message)]


def untold(several: Sequence[str], messages: Sequence[str]) -> list[str]:
    """Return those of several lines of facts of which no message names all.

    Of as many messages as lines; one more is a message that is not expected, and is returned.
    """
    missing = [facts for facts in several if all(unnamed(facts, line) for line in messages)]
    return missing + list(messages) * (len(messages) != len(several))


def naming(facts: str) -> str:
    """Return the pattern of a message that names all facts, in any order, as `match` takes it."""
    return r"(?s)\A" + "".join(f"(?=.*{_alone(fact)})" for fact in facts.split())


def _alone(fact: str) -> str:
    """Return the pattern of a fact that is no part of a longer word or number."""
    start = r"(?<!\w)" if re.match(r"[-+]?\w", fact) else ""
    start += r"(?<!\d\.)" if fact[0].isdigit() else ""
    end = r"(?!\w|\.\d)" if re.search(r"\w$", fact) else ""
    return start + re.escape(fact.replace("~", " ")).replace("…", r"\d*") + end
