"""Manual contact checking: a page to judge contacts on, the log of verdicts, and what the verdicts say."""
