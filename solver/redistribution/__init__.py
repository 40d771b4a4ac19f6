"""The nearest balanced forces where a contact is removed, a grain moved, or friction another one."""
