"""Check the facts that a message names, whatever its wording.

Facts are values, limits, options, keys and files, separated by blanks. In a fact "~" is a blank, as
in "5~kg", and "…" any digits. A fact is not found within a longer word or number: 1 is not in 1.5.
"""

import re
from collections.abc import Sequence


def unnamed(facts: str, message: str) -> list[str]:
    """Return the facts that a message does not name."""
    return [fact for fact in facts.split() if not re.search(_alone(fact), message)]


def untold(several: Sequence[str], messages: Sequence[str]) -> list[str]:
    """Return the lines of facts that no message names completely.

    If the numbers of lines and messages differ, return all messages as well.
    """
    missing = [facts for facts in several if all(unnamed(facts, line) for line in messages)]
    return missing + list(messages) * (len(messages) != len(several))


def naming(facts: str) -> str:
    """Return a pattern for `match` that a message with all facts matches, in any order."""
    return r"(?s)\A" + "".join(f"(?=.*{_alone(fact)})" for fact in facts.split())


def _alone(fact: str) -> str:
    """Return the pattern of a fact that is not part of a longer word or number."""
    start = r"(?<!\w)" if re.match(r"[-+]?\w", fact) else ""
    start += r"(?<!\d\.)" if fact[0].isdigit() else ""
    end = r"(?!\w|\.\d)" if re.search(r"\w$", fact) else ""
    return start + re.escape(fact.replace("~", " ")).replace("…", r"\d*") + end
