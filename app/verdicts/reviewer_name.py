"""The default name of a reviewer."""

from __future__ import annotations

import getpass

SHARED_ACCOUNTS = frozenset(
    ("root", "admin", "administrator", "user", "nobody", "runner")
)  # accounts that are no person's


def account_name() -> str:
    """Return the name of the user's account; empty for a shared account, so that the page requests a name."""
    try:
        name = getpass.getuser()
    except (OSError, KeyError):  # a machine without user names
        return ""
    return "" if name.lower() in SHARED_ACCOUNTS else name
