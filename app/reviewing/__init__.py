"""Manual checking of contacts: the pairs to judge, the verdicts of reviewers, the accuracy that follows from them.

The page is a step of the workbench; nothing here depends on HTTP."""
