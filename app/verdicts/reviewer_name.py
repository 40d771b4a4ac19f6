"""Who judges, where nobody has said it."""

from __future__ import annotations

import getpass

NOBODY = frozenset(("root", "admin", "administrator", "user", "nobody", "runner"))  # accounts of machines


def account_name() -> str:
    """The name of the account in which somebody sits; empty where it is nobody's own, so that a page asks."""
    try:
        name = getpass.getuser()
    except (OSError, KeyError):  # a machine without user names
        return ""
    return "" if name.lower() in NOBODY else name
